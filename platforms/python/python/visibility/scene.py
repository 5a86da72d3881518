"""Scenes from the objects of other packages, which are imported when they are needed."""

import json
import os

import numpy as np

from . import _visibility, ifc

#: Types of CityJSON's semantic surfaces that close an opening of a space, and are no matter.
_CITY_NO_MATTER = ("ClosureSurface", "WaterClosureSurface")
#: Types of CityJSON's city objects and semantic surfaces that hide nothing by themselves: what is seen through, or has
#: gaps that the surfaces leave out, or is a part of a building's space.
_CITY_TRANSPARENT = (
    "BuildingRoom",
    "BuildingStorey",
    "BuildingUnit",
    "PlantCover",
    "SolitaryVegetationObject",
    "WaterBody",
    "WaterSurface",
    "Window",
)


class Scene(_visibility.Scene):
    __doc__ = _visibility.Scene.__doc__

    @classmethod
    def from_trimesh(cls, source, *, occluder=None, origin=None, two_sided=False):
        """Makes a scene of a ``trimesh.Trimesh`` or ``trimesh.Scene``; of a scene, each placed mesh is an object, in
        the order of ``source.graph.nodes_geometry`` without those that have no triangles. ``origin``: ``None`` for the
        middle of the source.

        ``occluder``: a function of a mesh that tells whether the mesh hides what is behind it. ``None``: a mesh hides
        unless its material blends or is masked, or a colour or a picture without an alpha mode has an alpha below 1.
        trimesh does not read other transparency, such as the transmission of glTF: name such meshes by ``occluder``."""
        is_occluder = _is_opaque if occluder is None else occluder
        meshes, occluders = [], []
        if hasattr(source, "graph"):
            places = [source.graph[node] for node in source.graph.nodes_geometry]
            placed = [(source.geometry[name], transform) for transform, name in places]
        else:
            placed = [(source, np.eye(4))]
        for mesh, transform in placed:
            if not hasattr(mesh, "faces") or not len(mesh.faces):
                continue
            linear = np.asarray(transform, dtype=np.float64)[:3, :3]
            # A mirroring transform turns faces to the other side; the other order of corners turns them back. What a
            # transform makes flat may face either way, so it hides nothing where only the fronts of faces are drawn.
            sign = np.linalg.det(linear)
            is_flat = not abs(sign) > 1e-12 * np.prod(np.linalg.norm(linear, axis=0))
            faces = mesh.faces[:, ::-1] if sign < 0 else mesh.faces
            meshes.append((mesh.vertices @ linear.T + transform[:3, 3], faces))
            occluders.append(bool(is_occluder(mesh)) and (two_sided or not is_flat))
        return cls._from_meshes(meshes, origin, two_sided, occluders)

    @classmethod
    def from_ifc(
        cls, source, *, transparent=("IfcWindow", "IfcCurtainWall", "IfcPlate"), origin=None, two_sided=True
    ):
        """Makes a scene of an ``ifcopenshell.file`` or the path of one. Returns the scene and the GlobalIds of its
        objects, a list. Needs the package ifcopenshell. ``transparent``: classes that hide nothing. A product with a
        style whose transparency is above 0 hides nothing either, whatever its class. Bodies that are no matter are
        left out: spaces, zones, storeys and all other spatial elements but sites, voids such as openings, virtual
        elements, annotations, grids and alignments, ports, and the members and loads of structural analysis."""
        meshes, names, occluders = [], [], []
        for product, positions, triangles, hides in ifc.bodies(source, transparent):
            if ifc.is_matter(product):
                meshes.append((positions, triangles))
                names.append(product.GlobalId)
                occluders.append(hides)
        return cls._from_meshes(meshes, origin, two_sided, occluders), names

    @classmethod
    def from_cityjson(
        cls, source, *, lod=None, transparent=_CITY_TRANSPARENT, occluder=None, origin=None, two_sided=False
    ):
        """Makes a scene of a CityJSON file, or of what ``json.load`` made of one. Returns the scene and the ids of its
        objects, a list. ``lod``: the level of detail as a string; ``None`` for each object's finest with surfaces of
        its own. Objects without surfaces are left out, and so are copies of templates and surfaces of closure, which
        are no matter. Polygons are divided by the package mapbox_earcut.

        ``transparent``: types of city objects and of semantic surfaces that hide nothing; add ``"Door"`` for doors of
        glass. Surfaces of a material with a transparency above 0 hide nothing either. Pictures are not read.
        ``occluder``: a function of an id and its city object that tells whether the object hides what is behind it,
        its transparent surfaces aside; ``None`` for all but objects of the types ``transparent``. A city object with
        both kinds of surfaces becomes two objects of the same id, the transparent one last."""
        if isinstance(source, (str, os.PathLike)):
            with open(source, encoding="utf-8") as file:
                source = json.load(file)
        if not isinstance(source, dict) or source.get("type") != "CityJSON":
            raise ValueError("source: expected a CityJSON file")
        positions = np.array(source["vertices"], dtype=np.float64).reshape(-1, 3)
        if transform := source.get("transform"):
            positions = positions * transform["scale"] + transform["translate"]
        styles = source.get("appearance", {}).get("materials", [])
        is_clear_style = [style.get("transparency", 0) > 0 for style in styles]
        meshes, names, occluders = [], [], []
        for name, city_object in source["CityObjects"].items():
            geometries = [geometry for geometry in city_object.get("geometry", []) if _surfaces(geometry)]
            if lod is not None:
                geometries = [geometry for geometry in geometries if str(geometry.get("lod")) == str(lod)]
            if not geometries:
                continue
            finest = max(geometries, key=lambda geometry: float(geometry.get("lod", 0)))
            is_clear = city_object.get("type") in transparent
            hides = not is_clear if occluder is None else bool(occluder(name, city_object))
            parts = {True: [], False: []}
            for rings, kind, materials in _surfaces(finest):
                if kind not in _CITY_NO_MATTER:
                    # A material that the file does not have may be transparent.
                    clear = [is_clear_style[number] if number < len(is_clear_style) else True for number in materials]
                    is_clear = kind in transparent or any(clear)
                    parts[hides and not is_clear].append(_triangulated(positions, rings))
            for hides, triangles in parts.items():
                triangles = np.concatenate([*triangles, np.empty((0, 3), dtype=np.int64)])
                if len(triangles):
                    used, triangles = np.unique(triangles, return_inverse=True)
                    meshes.append((positions[used], triangles.reshape(-1, 3)))
                    names.append(name)
                    occluders.append(hides)
        return cls._from_meshes(meshes, origin, two_sided, occluders), names

    @classmethod
    def _from_meshes(cls, meshes, origin, two_sided, occluders):
        """Makes a scene of pairs of positions and triangles, of which none is empty, and whether each hides."""
        meshes = [(np.ascontiguousarray(points, dtype=np.float64), faces) for points, faces in meshes]
        if origin is None and meshes:
            low = np.min([points.min(axis=0) for points, _ in meshes], axis=0)
            high = np.max([points.max(axis=0) for points, _ in meshes], axis=0)
            origin = (low + high) / 2
        scene = cls(origin=(0.0, 0.0, 0.0) if origin is None else tuple(origin), two_sided=two_sided)
        for (points, faces), occluder in zip(meshes, occluders):
            scene.add_mesh(points, np.ascontiguousarray(faces, dtype=np.int64), occluder=occluder)
        return scene


def _is_opaque(mesh):
    """Tells whether a mesh of trimesh lets nothing through, as far as its visuals say."""
    visual = getattr(mesh, "visual", None)
    attributes = getattr(visual, "vertex_attributes", None) or {}
    colors = [getattr(visual, "face_colors", None), getattr(visual, "vertex_colors", None), attributes.get("color")]
    material = getattr(visual, "material", None)
    for part in getattr(material, "materials", None) or [material]:
        if getattr(part, "alphaMode", None) in ("BLEND", "MASK"):
            return False
        colors += [getattr(part, "baseColorFactor", None), getattr(part, "main_color", None)]
        # Of materials with an alpha mode, the mode tells whether the picture's alpha counts.
        image = None if hasattr(part, "alphaMode") else getattr(part, "image", None)
        if image is not None and np.asarray(image.convert("RGBA"))[..., 3].min(initial=255) < 255:
            return False
    return not any(map(_lets_through, colors))


def _lets_through(colors):
    """Tells whether one of the colours, or the only one, has an alpha that is not whole. ``None`` has none."""
    colors = np.asarray([] if colors is None else colors)
    if colors.ndim == 0 or colors.shape[-1] != 4:
        return False
    whole = 1.0 if colors.dtype.kind == "f" else 65535 if colors.dtype == np.uint16 else 255
    return not bool((colors[..., 3] >= whole).all())


def _surfaces(geometry):
    """Returns the surfaces of a CityJSON geometry: each a list of rings of vertex indices, the type of its semantic
    surface, or ``None``, and the numbers of its materials in all themes. None for copies of templates."""
    depths = {"MultiSurface": 0, "CompositeSurface": 0, "Solid": 1, "MultiSolid": 2, "CompositeSolid": 2}
    depth = depths.get(geometry.get("type"))
    if depth is None:
        return []
    semantics, boundaries = geometry.get("semantics") or {}, geometry.get("boundaries", [])
    themes = [theme.get("values", theme.get("value")) for theme in (geometry.get("material") or {}).values()]
    found = []
    for rings, kind, *materials in _beside(boundaries, [semantics.get("values"), *themes], depth):
        kind = None if kind is None else semantics["surfaces"][kind].get("type")
        found.append((rings, kind, [number for number in materials if number is not None]))
    return found


def _beside(boundaries, lists, depth):
    """Yields each surface of boundaries with its values in the lists, which are nested alike; a value that is no list
    counts for all within."""
    for number, part in enumerate(boundaries):
        # Lists may end early: no value is left for what is beyond.
        values = [(values[number : number + 1] or [None])[0] if isinstance(values, list) else values for values in lists]
        if depth == 0:
            yield part, *values
        else:
            yield from _beside(part, values, depth - 1)


def _triangulated(positions, rings):
    """Divides a flat polygon, the first ring with the others as holes, into triangles of indices, which face as it."""
    outer = np.asarray(rings[0], dtype=np.int64)
    if len(rings) == 1 and len(outer) == 3:
        return outer.reshape(1, 3)
    import mapbox_earcut

    # Relative to a corner, since the products of large coordinates would cancel.
    corners = positions[outer] - positions[outer[0]]
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    if not np.abs(normal).max() > 0:
        return np.empty((0, 3), dtype=np.int64)
    # Along the axis that the polygon faces most, seen so that it is counter-clockwise.
    axis = int(np.abs(normal).argmax())
    keep = [(1, 2), (2, 0), (0, 1)][axis]
    indices = np.concatenate([np.asarray(ring, dtype=np.int64) for ring in rings])
    flat = np.ascontiguousarray((positions[indices] - positions[outer[0]])[:, keep])
    ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
    triangles = mapbox_earcut.triangulate_float64(flat, ends).reshape(-1, 3).astype(np.int64)
    a, b, c = (flat[triangles[:, corner]] for corner in range(3))
    areas = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    turned = (areas > 0) != (normal[axis] > 0)
    triangles[turned] = triangles[turned][:, ::-1]
    return indices[triangles]
