"""Floor plans from polygons and building models."""

import numpy as np

from . import _visibility, ifc


def _ring_walls(ring):
    """Returns the walls along a ring of points, (n, 2, 2)."""
    ring = np.asarray(ring, dtype=np.float64)
    if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 2:
        raise ValueError(f"polygons: expected rings (n, 2), got {ring.shape}")
    if (ring[0] == ring[-1]).all():
        ring = ring[:-1]
    return np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)


class Plan(_visibility.Plan):
    __doc__ = _visibility.Plan.__doc__

    @classmethod
    def from_polygons(cls, polygons, *, margin=None):
        """Makes a plan of the outlines of polygons: rings (n, 2) of points, closed or not."""
        walls = [_ring_walls(ring) for ring in polygons]
        walls = np.concatenate(walls) if walls else np.empty((0, 2, 2))
        return cls(np.ascontiguousarray(walls), margin=margin)

    @classmethod
    def from_shapely(cls, geometry, *, margin=None):
        """Makes a plan of a shapely geometry: its lines, and the outlines and holes of its polygons."""
        from shapely import get_parts

        walls = []
        todo = [geometry]
        while todo:
            part = todo.pop()
            if part.is_empty:
                continue
            if part.geom_type == "Polygon":
                todo += [part.exterior, *part.interiors]
            elif hasattr(part, "geoms"):
                todo += list(get_parts(part))
            elif part.geom_type in ("LineString", "LinearRing"):
                points = np.asarray(part.coords, dtype=np.float64)[:, :2]
                walls.append(np.stack([points[:-1], points[1:]], axis=1))
            else:
                raise ValueError(f"geometry: a {part.geom_type} has no walls")
        walls = np.concatenate(walls) if walls else np.empty((0, 2, 2))
        return cls(np.ascontiguousarray(walls), margin=margin)

    @classmethod
    def from_ifc(
        cls, source, height, *, transparent=("IfcWindow", "IfcDoor", "IfcCurtainWall", "IfcPlate"), margin=None
    ):
        """Makes a plan of an ``ifcopenshell.file`` or the path of one: its walls and all else that hides, cut at a
        ``height`` in metres, in the model's coordinates. Returns the plan, and the rooms there: a dictionary of the
        GlobalIds of IfcSpace and their outlines, (n, 2, 2), which are no walls. Needs the package ifcopenshell.

        ``transparent``: classes that hide nothing, with which doors are open. A product with a style whose
        transparency is above 0 hides nothing either, whatever its class; what is no matter is left out, as by
        :meth:`Scene.from_ifc`."""
        walls, rooms = [np.empty((0, 2, 2))], {}
        for product, positions, triangles, hides in ifc.bodies(source, transparent):
            outline = ifc.cut(positions, triangles, height)
            if product.is_a("IfcSpace") and len(outline):
                rooms[product.GlobalId] = outline
            elif hides and ifc.is_matter(product):
                walls.append(outline)
        return cls(np.concatenate(walls), margin=margin), rooms
