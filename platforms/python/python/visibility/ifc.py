"""Bodies of IFC models, by the package ifcopenshell, which is imported when it is needed."""

import os

import numpy as np

#: Classes of IFC whose bodies are no matter. IfcSpatialElement and IfcPositioningElement came after IFC2X3. Sites are
#: spatial as well, and are ground.
_NO_MATTER = (
    "IfcAnnotation",
    "IfcFeatureElementSubtraction",
    "IfcGrid",
    "IfcLinearElement",
    "IfcPort",
    "IfcPositioningElement",
    "IfcSpatialElement",
    "IfcSpatialStructureElement",
    "IfcStructuralActivity",
    "IfcStructuralItem",
    "IfcVirtualElement",
)


def is_a(product, kinds):
    """Tells whether a product is of one of the classes, or of a class below one."""
    return any(product.is_a(kind) for kind in kinds)


def is_matter(product):
    """Tells whether the body of a product is matter: that of a wall is, that of a room or an opening is not."""
    return product.is_a("IfcSite") or not is_a(product, _NO_MATTER)


def bodies(source, transparent):
    """Yields of each body of an ``ifcopenshell.file``, or of the path of one: its product, positions (n, 3) in metres,
    triangles (m, 3) with m > 0, and whether it hides what is behind it, which products of the classes ``transparent``
    and products with a transparent style do not."""
    import ifcopenshell
    import ifcopenshell.geom

    model = ifcopenshell.open(os.fspath(source)) if isinstance(source, (str, os.PathLike)) else source
    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    iterator = ifcopenshell.geom.iterator(settings, model)
    more = iterator.initialize()
    while more:
        shape = iterator.get()
        product = model.by_guid(shape.guid)
        positions = np.array(shape.geometry.verts, dtype=np.float64).reshape(-1, 3)
        triangles = np.array(shape.geometry.faces, dtype=np.int64).reshape(-1, 3)
        # A style without a transparency has NaN, which is not above 0.
        is_clear = any(style.transparency > 0 for style in shape.geometry.materials) or is_a(product, transparent)
        if len(triangles):
            yield product, positions, triangles, not is_clear
        more = iterator.next()


def cut(positions, triangles, height):
    """Returns where triangles cross the level plane at a height, segments (k, 2, 2). A corner on the plane counts as
    above it, so that a body from the plane up is not cut, and one up to the plane is."""
    below = positions[:, 2] < height
    count = below[triangles].sum(axis=1)
    triangles = triangles[(count == 1) | (count == 2)]
    # The corner that is alone on its side of the plane comes first.
    is_low = below[triangles].sum(axis=1) == 1
    first = (below[triangles] == is_low[:, None]).argmax(axis=1)
    corners = positions[np.take_along_axis(triangles, (first[:, None] + (0, 1, 2)) % 3, axis=1)]
    alone, others = corners[:, :1], corners[:, 1:]
    # From the lower end of an edge to the upper one: so both triangles at the edge get the same point.
    low = np.where(is_low[:, None, None], alone, others)
    high = np.where(is_low[:, None, None], others, alone)
    share = (height - low[..., 2:]) / (high[..., 2:] - low[..., 2:])
    ends = (low + share * (high - low))[..., :2]
    return ends[(ends[:, 0] != ends[:, 1]).any(axis=1)]
