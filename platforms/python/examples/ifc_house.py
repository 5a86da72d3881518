"""Writes a house as an IFC file, by ifcopenshell's API: what the example of the garden reads where it is given none."""

import ifcopenshell.api.aggregate
import ifcopenshell.api.context
import ifcopenshell.api.feature
import ifcopenshell.api.geometry
import ifcopenshell.api.project
import ifcopenshell.api.root
import ifcopenshell.api.spatial
import ifcopenshell.api.unit
import numpy as np
from ifcopenshell.util.shape_builder import ShapeBuilder


class House:
    """An IFC4 file of boxes with a site, a building and one storey. Lengths in metres."""

    def __init__(self):
        self.file = ifcopenshell.api.project.create_file()
        project = self._entity("IfcProject", "garden")
        ifcopenshell.api.unit.assign_unit(self.file, length={"is_metric": True, "raw": "METERS"})
        model = ifcopenshell.api.context.add_context(self.file, context_type="Model")
        self.body = ifcopenshell.api.context.add_context(
            self.file, context_type="Model", context_identifier="Body", target_view="MODEL_VIEW", parent=model
        )
        self.site, building = self._entity("IfcSite", "lot"), self._entity("IfcBuilding", "house")
        self.storey = self._entity("IfcBuildingStorey", "ground floor")
        for part, whole in (self.site, project), (building, self.site), (self.storey, building):
            ifcopenshell.api.aggregate.assign_object(self.file, products=[part], relating_object=whole)

    def _entity(self, kind, name):
        return ifcopenshell.api.root.create_entity(self.file, ifc_class=kind, name=name)

    def shape(self, product, low, high):
        """Gives a product the body of a box."""
        builder = ShapeBuilder(self.file)
        low, size = np.asarray(low, float), np.subtract(high, low)
        body = builder.extrude(builder.rectangle(size=size[:2]), magnitude=size[2])
        representation = builder.get_representation(self.body, body)
        ifcopenshell.api.geometry.assign_representation(self.file, product=product, representation=representation)
        place = np.eye(4)
        place[:3, 3] = low
        ifcopenshell.api.geometry.edit_object_placement(self.file, product=product, matrix=place)

    def add(self, kind, name, low, high):
        """Adds a box to the storey, and returns its product."""
        product = self._entity(kind, name)
        if kind == "IfcSpace":
            ifcopenshell.api.aggregate.assign_object(self.file, products=[product], relating_object=self.storey)
        else:
            ifcopenshell.api.spatial.assign_container(self.file, products=[product], relating_structure=self.storey)
        self.shape(product, low, high)
        return product

    def open(self, walls, kind, name, low, high):
        """Cuts a box out of walls, and fills the first of the holes with a window or a door."""
        filling = self.add(kind, name, low, high)
        for number, wall in enumerate(walls):
            opening = self._entity("IfcOpeningElement", name)
            self.shape(opening, low, high)
            ifcopenshell.api.feature.add_feature(self.file, feature=opening, element=wall)
            if number == 0:
                ifcopenshell.api.feature.add_filling(self.file, opening=opening, element=filling)
