"""Scenes from the objects of other packages, which are imported when they are needed."""

import json
import os

import numpy as np

from . import _visibility


class Scene(_visibility.Scene):
    __doc__ = _visibility.Scene.__doc__

    @classmethod
    def from_trimesh(cls, source, *, origin=None, two_sided=False):
        """Makes a scene of a ``trimesh.Trimesh`` or ``trimesh.Scene``; of a scene, each placed mesh is an object, in
        the order of ``source.graph.nodes_geometry`` without those that have no triangles. ``origin``: ``None`` for the middle of the source."""
        if hasattr(source, "graph"):
            meshes = []
            for node in source.graph.nodes_geometry:
                transform, name = source.graph[node]
                mesh = source.geometry[name]
                if hasattr(mesh, "faces"):
                    meshes.append((mesh.vertices @ transform[:3, :3].T + transform[:3, 3], mesh.faces))
        else:
            meshes = [(source.vertices, source.faces)]
        return cls._from_meshes(meshes, origin, two_sided)

    @classmethod
    def from_ifc(
        cls, source, *, transparent=("IfcWindow", "IfcCurtainWall", "IfcPlate"), origin=None, two_sided=True
    ):
        """Makes a scene of an ``ifcopenshell.file`` or the path of one. Returns the scene and the GlobalIds of its
        objects, a list. Needs the package ifcopenshell. ``transparent``: classes that hide nothing; add those of
        other glass. Openings and spaces are left out."""
        import ifcopenshell
        import ifcopenshell.geom

        model = ifcopenshell.open(os.fspath(source)) if isinstance(source, (str, os.PathLike)) else source
        settings = ifcopenshell.geom.settings()
        settings.set("use-world-coords", True)
        meshes, names, occluders = [], [], []
        iterator = ifcopenshell.geom.iterator(settings, model)
        more = iterator.initialize()
        while more:
            shape = iterator.get()
            product = model.by_guid(shape.guid)
            positions = np.array(shape.geometry.verts, dtype=np.float64).reshape(-1, 3)
            triangles = np.array(shape.geometry.faces, dtype=np.int64).reshape(-1, 3)
            if len(triangles) and not product.is_a("IfcOpeningElement") and not product.is_a("IfcSpace"):
                meshes.append((positions, triangles))
                names.append(shape.guid)
                occluders.append(not any(product.is_a(kind) for kind in transparent))
            more = iterator.next()
        return cls._from_meshes(meshes, origin, two_sided, occluders), names

    @classmethod
    def from_cityjson(cls, source, *, lod=None, origin=None, two_sided=False):
        """Makes a scene of a CityJSON file, or of what ``json.load`` made of one. Returns the scene and the ids of its
        objects, a list. ``lod``: the level of detail as a string; ``None`` for each object's finest. Objects without
        surfaces are left out. Polygons are divided by the package mapbox_earcut."""
        if isinstance(source, (str, os.PathLike)):
            with open(source, encoding="utf-8") as file:
                source = json.load(file)
        if not isinstance(source, dict) or source.get("type") != "CityJSON":
            raise ValueError("source: expected a CityJSON file")
        positions = np.array(source["vertices"], dtype=np.float64).reshape(-1, 3)
        if transform := source.get("transform"):
            positions = positions * transform["scale"] + transform["translate"]
        meshes, names = [], []
        for name, city_object in source["CityObjects"].items():
            geometries = city_object.get("geometry", [])
            if lod is not None:
                geometries = [geometry for geometry in geometries if str(geometry.get("lod")) == str(lod)]
            if not geometries:
                continue
            finest = max(geometries, key=lambda geometry: float(geometry.get("lod", 0)))
            triangles = [_triangulated(positions, rings) for rings in _surfaces(finest)]
            triangles = np.concatenate(triangles) if triangles else np.empty((0, 3), dtype=np.int64)
            if len(triangles):
                used, triangles = np.unique(triangles, return_inverse=True)
                meshes.append((positions[used], triangles.reshape(-1, 3)))
                names.append(name)
        return cls._from_meshes(meshes, origin, two_sided), names

    @classmethod
    def _from_meshes(cls, meshes, origin, two_sided, occluders=None):
        """Makes a scene of pairs of positions and triangles."""
        meshes = [(np.ascontiguousarray(points, dtype=np.float64), faces) for points, faces in meshes if len(faces)]
        if origin is None and meshes:
            low = np.min([points.min(axis=0) for points, _ in meshes], axis=0)
            high = np.max([points.max(axis=0) for points, _ in meshes], axis=0)
            origin = (low + high) / 2
        scene = cls(origin=(0.0, 0.0, 0.0) if origin is None else tuple(origin), two_sided=two_sided)
        for number, (points, faces) in enumerate(meshes):
            occluder = True if occluders is None else occluders[number]
            scene.add_mesh(points, np.ascontiguousarray(faces, dtype=np.int64), occluder=occluder)
        return scene


def _surfaces(geometry):
    """Returns the surfaces of a CityJSON geometry, each a list of rings of vertex indices."""
    boundaries, kind = geometry.get("boundaries", []), geometry.get("type")
    if kind in ("MultiSurface", "CompositeSurface"):
        return boundaries
    if kind == "Solid":
        return [surface for shell in boundaries for surface in shell]
    if kind in ("MultiSolid", "CompositeSolid"):
        return [surface for solid in boundaries for shell in solid for surface in shell]
    return []


def _triangulated(positions, rings):
    """Divides a flat polygon, the first ring with the others as holes, into triangles of indices, which face as it."""
    outer = np.asarray(rings[0], dtype=np.int64)
    if len(rings) == 1 and len(outer) == 3:
        return outer.reshape(1, 3)
    import mapbox_earcut

    corners = positions[outer]
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    if not np.abs(normal).max() > 0:
        return np.empty((0, 3), dtype=np.int64)
    # Along the axis that the polygon faces most, seen so that it is counter-clockwise.
    axis = int(np.abs(normal).argmax())
    keep = [(1, 2), (2, 0), (0, 1)][axis]
    indices = np.concatenate([np.asarray(ring, dtype=np.int64) for ring in rings])
    flat = np.ascontiguousarray((positions[indices] - corners[0])[:, keep])
    ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
    triangles = mapbox_earcut.triangulate_float64(flat, ends).reshape(-1, 3).astype(np.int64)
    a, b, c = (flat[triangles[:, corner]] for corner in range(3))
    areas = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    turned = (areas > 0) != (normal[axis] > 0)
    triangles[turned] = triangles[turned][:, ::-1]
    return indices[triangles]
