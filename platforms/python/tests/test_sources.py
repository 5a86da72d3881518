"""Scenes from other packages' objects, which stand-ins replace here: what hides, and what is left out."""

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from visibility import Plan, Scene, View
from visibility.ifc import cut
from visibility.scene import _triangulated

AHEAD = View.perspective((0, 0, 0), (1, 0, 0), fov_y=1.0)
SQUARE = np.array([(0, -8, -8), (0, 8, -8), (0, 8, 8), (0, -8, 8)], dtype=float)
#: Two triangles that face -x, where the camera is.
FACES = np.array([(0, 2, 1), (0, 3, 2)])


def moved(x):
    matrix = np.eye(4)
    matrix[0, 3] = x
    return matrix


class Material(SimpleNamespace):
    """A material that knows no more than it is given."""


def mesh(visual=None):
    return SimpleNamespace(vertices=SQUARE, faces=FACES, visual=visual)


def scene_of(*placed, **options):
    """Makes a scene by way of a stand-in for ``trimesh.Scene``, of pairs of a mesh and its transform, and a lamp at x = 8."""
    geometry = {f"mesh {number}": mesh for number, (mesh, _) in enumerate(placed)}
    nodes = {f"node {number}": (transform, f"mesh {number}") for number, (_, transform) in enumerate(placed)}
    graph = type("Graph", (dict,), {"nodes_geometry": list(nodes)})(nodes)
    scene = Scene.from_trimesh(SimpleNamespace(graph=graph, geometry=geometry), **options)
    return scene, scene.add_boxes([[(8, -0.5, -0.5), (9, 0.5, 0.5)]])[0]


OPAQUE = [
    None,
    SimpleNamespace(face_colors=np.array([[9, 9, 9, 255]] * 2, np.uint8), vertex_colors=None),
    SimpleNamespace(material=Material(alphaMode="OPAQUE", baseColorFactor=[255, 0, 0, 255])),
    SimpleNamespace(material=Material(alphaMode=None, baseColorFactor=[1.0, 0.0, 0.0, 1.0])),
    SimpleNamespace(material=Material(main_color=np.array([1, 2, 3, 255], np.uint8))),
    SimpleNamespace(material=None, vertex_attributes={"color": np.array([[0, 0, 0, 65535]] * 4, np.uint16)}),
]
CLEAR = [
    SimpleNamespace(face_colors=np.array([[9, 9, 9, 255], [9, 9, 9, 254]], np.uint8)),
    SimpleNamespace(vertex_colors=np.array([[9, 9, 9, 255]] * 3 + [[9, 9, 9, 0]], np.uint8)),
    SimpleNamespace(material=Material(alphaMode="BLEND")),
    SimpleNamespace(material=Material(alphaMode="MASK")),
    SimpleNamespace(material=Material(baseColorFactor=[255, 0, 0, 128])),
    SimpleNamespace(material=Material(baseColorFactor=[1.0, 0.0, 0.0, 0.99])),
    SimpleNamespace(material=Material(main_color=np.array([1, 2, 3, 254], np.uint8))),
    SimpleNamespace(material=Material(materials=[Material(), Material(alphaMode="MASK")])),
    SimpleNamespace(material=None, vertex_attributes={"color": np.array([[0, 0, 0, 60000]] * 4, np.uint16)}),
]


@pytest.mark.parametrize("visual, hides", [(it, True) for it in OPAQUE] + [(it, False) for it in CLEAR])
def test_what_lets_light_through_hides_nothing(visual, hides):
    scene, lamp = scene_of((mesh(visual), moved(5)))
    assert (lamp not in scene.cull(AHEAD)) == hides
    assert len(Scene.from_trimesh(mesh(visual))) == 1


@pytest.mark.parametrize("alpha", [255, 254])
def test_the_alpha_of_a_picture_counts_where_no_mode_says_so(alpha):
    pixels = np.full((2, 2, 4), 255, np.uint8)
    pixels[1, 0, 3] = alpha
    image = SimpleNamespace(convert=lambda mode: pixels if mode == "RGBA" else None)
    scene, lamp = scene_of((mesh(SimpleNamespace(material=Material(image=image))), moved(5)))
    assert (lamp in scene.cull(AHEAD)) == (alpha < 255)
    scene, lamp = scene_of((mesh(SimpleNamespace(material=Material(image=image, alphaMode=None))), moved(5)))
    assert lamp not in scene.cull(AHEAD)


def test_a_function_tells_what_hides():
    glass, wall = mesh(SimpleNamespace(name="glass")), mesh(SimpleNamespace(name="wall"))
    for pane, behind in [(glass, True), (wall, False)]:
        scene, lamp = scene_of((pane, moved(5)), occluder=lambda mesh: mesh.visual.name != "glass")
        assert (lamp in scene.cull(AHEAD)) == behind


@pytest.mark.parametrize("along", [(-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, -1), (1, -1, -1), (1, 1, 1)])
def test_mirrored_meshes_keep_their_fronts(along):
    # Of a one-sided square, the front hides and the back does not. Mirroring along x alone turns the front away.
    transform = moved(5) @ np.diag([*along, 1.0])
    scene, lamp = scene_of((mesh(), transform))
    assert (lamp not in scene.cull(AHEAD)) == (along[0] > 0)
    back = View.perspective((20, 0, 0), (0, 0, 0), fov_y=1.0)
    lamp = scene.add_boxes([[(1, 1, 1), (2, 2, 2)]])[0]
    assert (lamp not in scene.cull(back)) == (along[0] < 0)


def test_flattened_meshes_hide_only_from_both_sides():
    transform = moved(5) @ np.diag([0.0, 1.0, 1.0, 1.0])
    for two_sided in (False, True):
        scene, lamp = scene_of((mesh(), transform), two_sided=two_sided)
        assert (lamp in scene.cull(AHEAD)) != two_sided


def test_nearly_flattened_meshes_are_seen_from_both_sides():
    # A renderer's rounding decides which side is the front: nothing is hidden behind, and the back is no proof.
    half = np.sqrt(0.5)
    turn = np.array([(half, -half, 0, 0), (half, half, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)])
    scene, lamp = scene_of((mesh(), moved(5) @ np.diag([1e-6, 1, 1, 1]) @ turn))
    assert lamp in scene.cull(AHEAD)
    seen, hidden, _, _ = scene.prove_from_region([[6, -0.5, -0.5], [7, 0.5, 0.5]])
    assert 0 in seen and 0 not in hidden


def test_each_material_tells_whether_its_back_is_drawn():
    behind = [[7, -0.5, -0.5], [7.5, 0.5, 0.5]]
    back = View.perspective((7, 0, 0), (0, 0, 0), fov_y=1.0)
    one, two = (Material(doubleSided=sides) for sides in (False, True))
    for material, hides, shows in [
        (one, (True, False), False),
        (two, (True, True), True),
        (Material(materials=[one, two]), (False, False), True),
    ]:
        scene, lamp = scene_of((mesh(SimpleNamespace(material=material)), moved(5)))
        hides_lamp = lamp not in scene.cull(AHEAD)
        before = scene.add_boxes([[(2, -0.5, -0.5), (3, 0.5, 0.5)]])[0]
        assert (hides_lamp, before not in scene.cull(back)) == hides
        seen, hidden, _, _ = scene.prove_from_region(behind)
        assert (0 in seen, 0 in hidden) == (shows, not shows)


def with_extensions(**levels):
    """A stand-in for a ``trimesh.Scene`` of a square at x = 5, with extensions of its node, of the node above, of its
    mesh and of the file."""
    square = mesh()
    square.metadata = {"gltf_extensions": levels.get("mesh", {})}
    edges = {("world", "above"): "above", ("above", "node"): "node"}
    data = {edge: {"metadata": {"gltf_extensions": levels.get(of, {})}} for edge, of in edges.items()}
    forest = SimpleNamespace(parents={"node": "above", "above": "world"}, edge_data=data)
    graph = type("Graph", (dict,), {"nodes_geometry": ["node"], "transforms": forest})(node=(moved(5), "mesh"))
    return SimpleNamespace(graph=graph, geometry={"mesh": square}, metadata={"gltf_extensions": levels.get("file", {})})


@pytest.mark.parametrize("of", ["node", "above", "mesh"])
@pytest.mark.parametrize(
    "extension",
    [
        {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 0}}},
        {"MSFT_lod": {"ids": [1]}},
        {"KHR_physics_rigid_bodies": {"motion": {}}},
        {"OMI_physics_body": {"motion": {"type": "dynamic"}}},
        {"OTHER_tool": {}},
    ],
)
def test_what_an_extension_may_move_is_always_visible_and_hides_nothing(of, extension):
    scene = Scene.from_trimesh(with_extensions(**{of: extension}))
    lamp = scene.add_boxes([[(8, -0.5, -0.5), (9, 0.5, 0.5)]])[0]
    assert scene.cull(AHEAD).tolist() == [0, lamp]
    away = View.perspective((0, 0, 0), (-1, 0, 0), fov_y=1.0)
    assert scene.cull(away).tolist() == [0]


def test_extensions_that_move_nothing_leave_walls():
    still = {"KHR_lights_punctual": {"light": 0}, "KHR_node_visibility": {"visible": True}}
    still |= {"KHR_physics_rigid_bodies": {"collider": {}}, "OMI_physics_body": {"type": "static"}}
    for levels, hides in [
        ({"node": still, "above": still, "file": {"KHR_lights_punctual": {}}}, True),
        ({"file": {"VRMC_springBone": {}}}, False),
    ]:
        scene = Scene.from_trimesh(with_extensions(**levels))
        lamp = scene.add_boxes([[(8, -0.5, -0.5), (9, 0.5, 0.5)]])[0]
        assert (lamp not in scene.cull(AHEAD)) == hides


@pytest.mark.parametrize("of", ["node", "above"])
def test_hidden_nodes_are_left_out(of):
    assert len(Scene.from_trimesh(with_extensions(**{of: {"KHR_node_visibility": {"visible": False}}}))) == 0


#: Classes above the classes of the stand-in for an IFC file, in IFC4X3.
ABOVE = {
    "IfcWall": ["IfcBuiltElement", "IfcElement"],
    "IfcWindow": ["IfcBuiltElement", "IfcElement"],
    "IfcSite": ["IfcSpatialStructureElement", "IfcSpatialElement"],
    "IfcSpace": ["IfcSpatialStructureElement", "IfcSpatialElement"],
    "IfcBuildingStorey": ["IfcSpatialStructureElement", "IfcSpatialElement"],
    "IfcSpatialZone": ["IfcSpatialElement"],
    "IfcExternalSpatialElement": ["IfcExternalSpatialStructureElement", "IfcSpatialElement"],
    "IfcOpeningElement": ["IfcFeatureElementSubtraction", "IfcFeatureElement", "IfcElement"],
    "IfcVoidingFeature": ["IfcFeatureElementSubtraction", "IfcFeatureElement", "IfcElement"],
    "IfcVirtualElement": ["IfcElement"],
    "IfcAnnotation": [],
    "IfcGrid": ["IfcPositioningElement"],
    "IfcReferent": ["IfcPositioningElement"],
    "IfcStructuralSurfaceMember": ["IfcStructuralMember", "IfcStructuralItem"],
}
MATTER = ("IfcWall", "IfcWindow", "IfcSite")


def stand_in(monkeypatch, bodies, above=ABOVE):
    """Puts a stand-in in the place of ifcopenshell, and returns a model of bodies: each a class, positions, triangles, and
    the transparencies of its styles."""
    shapes = []
    for kind, positions, triangles, styles in bodies:
        materials = [SimpleNamespace(transparency=transparency) for transparency in styles]
        geometry = SimpleNamespace(verts=np.ravel(positions), faces=np.ravel(triangles), materials=materials)
        shapes.append(SimpleNamespace(guid=kind, geometry=geometry))

    def product(kind):
        return SimpleNamespace(GlobalId=kind, is_a=lambda name: name == kind or name in above[kind])

    def iterator(settings, model):
        rest = iter(shapes[1:])
        now = [shapes[0]]

        def more():
            now[0] = next(rest, None)
            return now[0] is not None

        return SimpleNamespace(initialize=lambda: True, get=lambda: now[0], next=more)

    package, geom = ModuleType("ifcopenshell"), ModuleType("ifcopenshell.geom")
    geom.settings, geom.iterator, package.geom = lambda: SimpleNamespace(set=lambda *_: None), iterator, geom
    monkeypatch.setitem(sys.modules, "ifcopenshell", package)
    monkeypatch.setitem(sys.modules, "ifcopenshell.geom", geom)
    return SimpleNamespace(by_guid=product)


def ifc(monkeypatch, products, above=ABOVE):
    """Returns the scene and GlobalIds of a model of products: pairs of a class and the transparencies of its styles, as
    squares at x = 5, with a lamp behind them."""
    bodies = [(kind, SQUARE + (5, 0, 0), FACES, styles) for kind, styles in products]
    scene, names = Scene.from_ifc(stand_in(monkeypatch, bodies, above))
    return scene, names, scene.add_boxes([[(8, -0.5, -0.5), (9, 0.5, 0.5)]])[0]


@pytest.mark.parametrize("kind", list(ABOVE))
def test_bodies_of_ifc_that_are_no_matter_are_left_out(monkeypatch, kind):
    scene, names, lamp = ifc(monkeypatch, [(kind, [])])
    assert names == ([kind] if kind in MATTER else [])
    assert (lamp not in scene.cull(AHEAD)) == (kind in ("IfcWall", "IfcSite"))


def test_classes_of_ifc_2x3(monkeypatch):
    above = {"IfcBuildingStorey": ["IfcSpatialStructureElement"], "IfcSite": ["IfcSpatialStructureElement"], "IfcGrid": []}
    assert ifc(monkeypatch, [(kind, []) for kind in above], above)[1] == ["IfcSite"]


@pytest.mark.parametrize("styles, hides", [([], True), ([0.0], True), ([float("nan")], True), ([0.0, 0.1], False)])
def test_transparent_styles_of_ifc_hide_nothing(monkeypatch, styles, hides):
    scene, names, lamp = ifc(monkeypatch, [("IfcWall", styles)])
    assert (names, lamp not in scene.cull(AHEAD)) == (["IfcWall"], hides)


#: The triangles of a box of corners in the order of `box_corners`.
BOX = [(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)]


def box_corners(low, high):
    return np.array([[(low, high)[number >> axis & 1][axis] for axis in range(3)] for number in range(8)], dtype=float)


def test_plans_of_ifc(monkeypatch):
    above = {**ABOVE, "IfcDoor": ["IfcBuiltElement", "IfcElement"], "IfcSlab": ["IfcBuiltElement", "IfcElement"]}
    places = {
        "IfcWall": [(5, -3, 0), (5.2, 3, 2.5)],
        "IfcDoor": [(5, 3, 0), (5.2, 4, 2)],
        "IfcWindow": [(5, 4, 1), (5.2, 5, 2)],
        "IfcSlab": [(5, 5, 0), (5.2, 6, 1.5)],
        "IfcOpeningElement": [(5, 6, 0), (5.2, 7, 2)],
        "IfcSpace": [(0, -3, 0), (5, 7, 2.5)],
    }
    bodies = [(kind, box_corners(*place), BOX, []) for kind, place in places.items()]
    model = stand_in(monkeypatch, bodies, above)
    eyes = np.tile((1.0, 0.5), (5, 1))
    lamps = [(9.0, (2 * y - 0.5)) for y in (0.5, 3.5, 4.5, 5.5, 6.5)]
    # A body up to the plane is cut, where each side face adds one segment in place of two; one from the plane up is not.
    for height, slab, wall in (1.4, 8, 8), (1.5, 4, 8), (1.6, 0, 8), (2.5, 0, 4), (2.6, 0, 0):
        plan, rooms = Plan.from_ifc(model, height)
        assert len(plan) == slab + wall and list(rooms) == ["IfcSpace"] * (height < 2.6), height
        hides = [wall > 0, False, False, slab > 0, False]
        assert plan.sees(eyes, lamps).tolist() == [not it for it in hides], height
        for outline in rooms.values():
            assert (outline.min(axis=(0, 1)).tolist(), outline.max(axis=(0, 1)).tolist()) == ([0, -3], [5, 7])
    assert len(Plan.from_ifc(model, 0.0)[0]) == 0
    glass = stand_in(monkeypatch, [("IfcWall", bodies[0][1], BOX, [0.5])], above)
    assert len(Plan.from_ifc(glass, 1.0)[0]) == 0
    doors = stand_in(monkeypatch, bodies, above)
    assert len(Plan.from_ifc(doors, 1.8, transparent=())[0]) == 24


def test_cuts_of_slanted_bodies_are_closed():
    # Both triangles at an edge get the same point: each end of a segment is that of another.
    random = np.random.default_rng(3)
    for seed in range(20):
        turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
        corners = box_corners((-1, -2, -3), (1, 2, 3)) @ turn + random.normal(size=3)
        outline = cut(corners, np.array(BOX), corners[:, 2].mean())
        ends, counts = np.unique(outline.reshape(-1, 2), axis=0, return_counts=True)
        assert len(outline) >= 6 and (counts == 2).all(), seed


def city(*surfaces, kind="Building", solid=False, **parts):
    """A CityJSON file with one city object: of squares at x = 5, each of two triangles of a semantic type and material."""
    boundaries = [[[0, 2, 1]], [[0, 3, 2]]] * len(surfaces)
    values = [number for number in range(len(surfaces)) for _ in range(2)]
    materials = [material for _, material in surfaces for _ in range(2)]
    wrap = (lambda items: [items]) if solid else (lambda items: items)
    geometry = {
        "type": "Solid" if solid else "MultiSurface",
        "lod": "2",
        "boundaries": wrap(boundaries),
        "semantics": {"surfaces": [{"type": kind} for kind, _ in surfaces], "values": wrap(values)},
        "material": {"": {"values": wrap(materials)}},
    }
    return {
        "type": "CityJSON",
        "vertices": (SQUARE + (5, 0, 0)).tolist(),
        "appearance": {"materials": [{"name": "brick"}, {"name": "glass", "transparency": 0.5}]},
        "CityObjects": {"it": {"type": kind, "geometry": [geometry]}},
        **parts,
    }


WALL, WINDOW = ("WallSurface", None), ("Window", 0)


@pytest.mark.parametrize("solid", [False, True])
@pytest.mark.parametrize("surfaces, objects, hides", [
    ([WALL], 1, True),
    ([("WallSurface", 0)], 1, True),
    ([("Door", 0)], 1, True),
    ([WINDOW], 1, False),
    ([("WallSurface", 1)], 1, False),
    ([WALL, WINDOW], 2, True),
    ([WINDOW, WALL], 2, True),
    ([WINDOW, ("RoofSurface", 1)], 1, False),
    ([("ClosureSurface", 0)], 0, False),
    ([("ClosureSurface", 0), WINDOW], 1, False),
])  # fmt: skip
def test_surfaces_of_cities(surfaces, objects, hides, solid):
    scene, names = Scene.from_cityjson(city(*surfaces, solid=solid))
    lamp = scene.add_boxes([[(8, -0.5, -0.5), (9, 0.5, 0.5)]])[0]
    assert (names, lamp not in scene.cull(AHEAD)) == (["it"] * objects, hides)


def test_which_objects_of_cities_hide():
    def hides(file, **options):
        scene, _ = Scene.from_cityjson(file, **options)
        return scene.add_boxes([[(8, -0.5, -0.5), (9, 0.5, 0.5)]])[0] not in scene.cull(AHEAD)

    tree = city(WALL, kind="SolitaryVegetationObject")
    assert [hides(city(WALL)), hides(tree), hides(tree, transparent=())] == [True, False, True]
    assert not hides(city(("Door", 0)), transparent=("Door",))
    told = []
    assert not hides(city(WALL), occluder=lambda *given: told.append(given))
    assert told == [("it", city(WALL)["CityObjects"]["it"])]
    assert [hides(city(one), occluder=lambda *_: True) for one in (WALL, WINDOW)] == [True, False]
    whole = city(WALL)
    whole["CityObjects"]["it"]["geometry"][0]["material"] = {"summer": {"value": 0}, "winter": {"value": 1}}
    assert not hides(whole), "one material for all surfaces, in one of two themes"
    del whole["CityObjects"]["it"]["geometry"][0]["material"], whole["CityObjects"]["it"]["geometry"][0]["semantics"]
    assert hides(whole), "without semantics and materials"


def test_copies_of_templates_do_not_replace_surfaces():
    file = city(WALL)
    copy = {"type": "GeometryInstance", "lod": "3", "template": 0, "boundaries": [0], "transformationMatrix": np.eye(4).ravel().tolist()}
    file["CityObjects"]["it"]["geometry"].append(copy)
    file["CityObjects"]["copy"] = {"type": "Building", "geometry": [copy]}
    scene, names = Scene.from_cityjson(file)
    assert (len(scene), names) == (1, ["it"])


def test_polygons_far_from_the_origin_keep_their_fronts():
    pytest.importorskip("mapbox_earcut")
    # The products of the coordinates are far larger than the area of the quadrangle.
    for at in ((0, 0, 0), (155e3, 463e3, 50), (4e6, 5e6, 3e6)):
        for side in (0.1, 0.01, 0.001):
            positions = side * np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) + at
            for ring, up in ([0, 1, 2, 3], 1), ([2, 1, 0, 3], -1), ([3, 0, 1, 2], 1):
                triangles = _triangulated(positions, [ring])
                a, b, c = (positions[triangles[:, corner]] for corner in range(3))
                assert len(triangles) == 2, (at, side, ring)
                assert (np.sign(np.cross(b - a, c - a)) == (0, 0, up)).all(), (at, side, ring)
