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
#: Extensions of glTF's nodes and meshes that neither move a mesh nor draw another in its place.
_GLTF_STILL = (
    "AGI_stk_metadata",
    "EXT_instance_features",
    "EXT_lights_ies",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    "GRIFFEL_bim_data",
    "KHR_audio",
    "KHR_audio_emitter",
    "KHR_lights_punctual",
    "KHR_node_hoverability",
    "KHR_node_selectability",
    "KHR_node_visibility",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "MSFT_audio_emitter",
    "OMI_audio_emitter",
    "OMI_collider",
    "OMI_link",
    "OMI_physics_joint",
    "OMI_physics_shape",
    "OMI_seat",
    "OMI_spawn_point",
)
#: Extensions of glTF's documents whose nodes a program moves: figures, and graphs that set whatever they name.
_GLTF_MOVING = ("KHR_interactivity", "MPEG_scene_dynamic", "VRM", "VRMC_springBone", "VRMC_vrm")


def _is_misread(mesh):
    """Whether the positions of a mesh look like those that trimesh does not read: placeholders at one point, or whole
    numbers that stand for parts of the greatest of their type. A mesh of a glTF file, which is in metres, may have
    a range of them that other meshes fill; of other meshes those that fill their range themselves are told."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    if not len(vertices) or (vertices == vertices[0]).all():
        return True
    greatest = np.abs(vertices).max()
    is_gltf = "from_gltf_primitive" in (getattr(mesh, "metadata", None) or {})
    is_range = greatest >= 127 if is_gltf else greatest in (127, 255, 32767, 65535)
    return bool(is_range and (vertices == np.rint(vertices)).all())


class Scene(_visibility.Scene):
    __doc__ = _visibility.Scene.__doc__

    @classmethod
    def from_trimesh(cls, source, *, occluder=None, origin=None, two_sided=False):
        """Makes a scene of a ``trimesh.Trimesh`` or ``trimesh.Scene``; of a scene, each placed mesh is an object, in
        the order of ``source.graph.nodes_geometry`` without those that have no triangles or are below a node that is
        hidden (``KHR_node_visibility``). ``origin``: ``None`` for the middle of the source. ``two_sided``: whether all
        meshes show and hide from behind as well; otherwise those whose material is ``doubleSided`` do.

        Always visible, and hides nothing: a mesh that an extension of glTF may move, copy or replace, as far as
        trimesh keeps it with the nodes and meshes. Such are ``EXT_mesh_gpu_instancing``, ``MSFT_lod``, bodies of a
        simulation that are not static, figures of VRM, and all extensions that this package does not know; and meshes
        whose positions trimesh reads wrongly: compressed ones (``KHR_draco_mesh_compression`` without DracoPy), and
        normalized whole numbers (``KHR_mesh_quantization``). A mesh of a glTF file counts as such if all its
        coordinates are whole and one is 127 or more, any other mesh if the greatest is 127, 255, 32767 or 65535.
        trimesh does not keep skins, clips, morph targets, sparse accessors and ``KHR_materials_variants``: what these
        change is an object as trimesh gives it, at rest. Leave such meshes out of the source, and add a box around
        all of their poses by ``add_boxes(..., solid=False)``.

        ``occluder``: a function of a mesh that tells whether the mesh hides what is behind it. ``None``: a mesh hides
        unless its material blends or is masked, or a colour or a picture without an alpha mode has an alpha below 1.
        trimesh does not read other transparency, such as the transmission of glTF: name such meshes by ``occluder``."""
        is_occluder = _is_opaque if occluder is None else occluder
        meshes, occluders, sides = [], [], []
        if hasattr(source, "graph"):
            of_file = (getattr(source, "metadata", None) or {}).get("gltf_extensions") or {}
            is_figure = any(name in of_file for name in _GLTF_MOVING)
            placed = []
            for node in source.graph.nodes_geometry:
                transform, name = source.graph[node]
                extensions = list(_node_extensions(source.graph, node))
                # A graph of a document may show what is hidden at first.
                if is_figure or not any(_is_hidden(*extension) for extension in extensions):
                    placed.append((source.geometry[name], transform, is_figure or any(map(_may_move, extensions))))
        else:
            placed = [(source, np.eye(4), False)]
        for mesh, transform, may_move in placed:
            if not hasattr(mesh, "faces") or not len(mesh.faces):
                continue
            of_mesh = (getattr(mesh, "metadata", None) or {}).get("gltf_extensions") or {}
            if may_move or any(map(_may_move, of_mesh.items())) or _is_misread(mesh):
                meshes.append(None)
                occluders.append(False)
                sides.append(None)
                continue
            drawn = {True} if two_sided else _drawn_sides(mesh)
            linear = np.asarray(transform, dtype=np.float64)[:3, :3]
            # A mirroring transform turns faces to the other side; the other order of corners turns them back. What a
            # transform makes flat may face either way, so it hides nothing where only the fronts of faces are drawn.
            sign = np.linalg.det(linear)
            is_flat = not abs(sign) > 1e-5 * np.prod(np.linalg.norm(linear, axis=0))
            faces = mesh.faces[:, ::-1] if sign < 0 else mesh.faces
            meshes.append((mesh.vertices @ linear.T + transform[:3, 3], faces))
            # What is two-sided in part is seen from both sides, and hides from neither for certain.
            is_certain = len(drawn) == 1 and (True in drawn or not is_flat)
            occluders.append(bool(is_occluder(mesh)) and is_certain)
            sides.append(True in drawn or is_flat)
        return cls._from_meshes(meshes, origin, two_sided, occluders, sides)

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
    def _from_meshes(cls, meshes, origin, two_sided, occluders, sides=None):
        """Makes a scene of pairs of positions and triangles, of which none is empty, whether each hides, and whether
        each is two-sided, if they differ. In the place of a pair, ``None`` is an object that is always visible."""
        known = [np.ascontiguousarray(mesh[0], dtype=np.float64) for mesh in meshes if mesh is not None]
        if origin is None and known:
            low = np.min([points.min(axis=0) for points in known], axis=0)
            high = np.max([points.max(axis=0) for points in known], axis=0)
            origin = (low + high) / 2
        scene = cls(origin=(0.0, 0.0, 0.0) if origin is None else tuple(origin), two_sided=two_sided)
        points = iter(known)
        for mesh, occluder, side in zip(meshes, occluders, sides or [None] * len(meshes)):
            if mesh is None:
                scene.add_boxes(np.full((1, 2, 3), np.nan), solid=False)
                continue
            faces = np.ascontiguousarray(mesh[1], dtype=np.int64)
            scene.add_mesh(next(points), faces, occluder=occluder, two_sided=side)
        return scene


def _node_extensions(graph, node):
    """Yields names and values of the glTF extensions of a node of trimesh's graph, and of those above it."""
    forest = getattr(graph, "transforms", None)
    parents = getattr(forest, "parents", {})
    for _ in range(len(parents)):
        if node not in parents:
            break
        edge = forest.edge_data.get((parents[node], node)) or {}
        yield from ((edge.get("metadata") or {}).get("gltf_extensions") or {}).items()
        node = parents[node]


def _is_hidden(name, value):
    """Tells whether an extension of a node hides the node."""
    return name == "KHR_node_visibility" and isinstance(value, dict) and value.get("visible") is False


def _may_move(extension):
    """Tells whether an extension of a node or a mesh, a name and a value, may move or replace what is drawn."""
    name, value = extension
    if name == "KHR_physics_rigid_bodies" and isinstance(value, dict):
        return "motion" in value
    if name == "OMI_physics_body" and isinstance(value, dict):
        motion = value.get("motion")
        return (motion.get("type") if isinstance(motion, dict) else value.get("type")) != "static"
    return name not in _GLTF_STILL


def _drawn_sides(mesh):
    """Returns for the materials of a mesh of trimesh whether they are two-sided: one flag, or both if they differ."""
    material = getattr(getattr(mesh, "visual", None), "material", None)
    return {bool(getattr(part, "doubleSided", False)) for part in getattr(material, "materials", None) or [material]}


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
