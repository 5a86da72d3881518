"""Scenes: culling, regions, bakes, the judge, and scenes of other packages."""

import io
import json
import threading

import numpy as np
import pytest
from visibility import BakedSet, Scene, View
from worlds import AHEAD, LAMP, WALL, city

BEHIND = [(-9.0, -1.0, -1.0), (-8.0, 1.0, 1.0)]


@pytest.fixture
def street():
    """A wall, a lamp behind the wall, and a box behind the eye."""
    scene = Scene()
    assert scene.add_boxes([WALL, LAMP, BEHIND]).tolist() == [0, 1, 2]
    return scene


def test_cull(street):
    assert street.cull(AHEAD).tolist() == [0]
    assert street.cull(AHEAD, occlusion=False).tolist() == [0, 1]
    assert street.cull(AHEAD, mask=True).tolist() == [True, False, False]
    back = View.orthographic((0, 0, 0), (-1, 0, 0), 4.0, 4.0)
    assert street.cull(back).tolist() == [2]
    assert len(street) == 3 and repr(street) == "Scene(3 objects)"
    assert (street.bounds[0, 0] <= WALL[0]).all() and street.bounds.shape == (3, 2, 3)


def test_matrix_and_pose_are_one_camera(street):
    # OpenGL, from the eye at 0 along +x with up z: clip x = -y, clip y = z, w = x; fov 90 degrees.
    near, far = 0.1, 100.0
    a, b = (far + near) / (far - near), -2 * far * near / (far - near)
    matrix = np.array([[0, -1, 0, 0], [0, 0, 1, 0], [a, 0, 0, b], [1, 0, 0, 0]], dtype=np.float64)
    assert street.cull(View.from_matrix(matrix), occlusion=False).tolist() == [0, 1]
    assert street.cull(View.from_matrix(np.ascontiguousarray(matrix)[[0, 1, 2, 3]])).tolist() == [0]
    assert "eye" in repr(AHEAD) or "View(" in repr(AHEAD)


def test_boxes_thinner_than_single_precision_hide_nothing():
    # A number of single precision has half a metre to the next here.
    wall = [[500002, 5400000.2, -50], [500020, 5400000.4, 50]]
    target = [[500100, 5400000.05, 1], [500101, 5400000.15, 2]]
    view = View.perspective((500000, 5400000.1, 1.5), (500010, 5400000.1, 1.5))
    scene = Scene()
    scene.add_boxes([wall, target])
    for occlusion in ("z_buffer", "occlusion_tree"):
        assert 1 in scene.cull(view, occlusion=occlusion), f"seen beside the wall: {occlusion}"
    scene = Scene()
    scene.add_boxes([[[500002, 5399990, -50], [500020, 5400010, 50]], target])
    assert 1 not in scene.cull(view, occlusion="occlusion_tree"), "behind a wall of 20 metres"


def test_boxes_without_shape_move_and_hide_nothing():
    scene = Scene(origin=(1e6, 0, 0))
    boxes = np.array([WALL, LAMP]) + (1e6, 0, 0)
    ids = scene.add_boxes(boxes, solid=False)
    view = View.perspective((1e6, 0, 0), (1e6 + 1, 0, 0))
    assert scene.cull(view).tolist() == [0, 1]
    scene.move_boxes(ids[:1], boxes[:1] - (50, 0, 0))
    assert scene.cull(view).tolist() == [1]
    scene.add_boxes(boxes[:1])
    with pytest.raises(ValueError, match="ids: object 2 has triangles"):
        scene.move_boxes([2], boxes[:1])


def test_no_culler_misses_what_pixels_show():
    scene = Scene(origin=(300, 300, 0))
    scene.add_boxes(city(20))
    random = np.random.default_rng(2)
    for frame in range(6):
        block = random.integers(2, 18, 2) * 30.0
        eye = (*block, 1.7)
        view = View.perspective(eye, (*(block + random.normal(0, 1, 2)), 1.7))
        ids = scene.cull(view)
        missed, in_vain = scene.compare(view, ids)
        assert missed.tolist() == [], frame
        assert len(ids) < 200, frame
        shown = np.unique(scene.item_buffer(view))
        assert set(shown[shown >= 0]) <= set(ids), frame
        # The judge finds what is missing.
        missed, _ = scene.compare(view, ids[1:])
        assert set(missed) <= {ids[0]}
    assert scene.compare(view, [])[0].tolist() == shown[shown >= 0].tolist()
    assert scene.item_buffer(view, size=(64, 36)).shape == (36, 64)


def test_joined_occluders_hide_through_seams():
    # A wall of tiles that share corners: no tile covers the lamp.
    scene = Scene()
    y, z = np.meshgrid(np.arange(-10, 10), np.arange(-10, 10))
    for corner in np.column_stack([y.ravel(), z.ravel()]) * 0.5:
        points = np.array([(5.0, *(corner + step)) for step in ((0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5))])
        scene.add_mesh(points, [(0, 2, 1), (0, 3, 2)])
    lamp = scene.add_boxes([[(8, -0.2, -0.2), (8.2, 0.2, 0.2)]])[0]
    polygons = scene.join_occluders()
    assert polygons < 100
    assert lamp not in scene.cull(AHEAD)
    scene.add_boxes([BEHIND])
    assert 400 in scene.cull(AHEAD) or lamp not in scene.cull(AHEAD)


def test_regions(street):
    region = [(-1, -1, -1), (0, 1, 1)]
    assert street.seen_from_region(region).tolist() == [0, 2]
    seen, hidden, undecided, sights = street.prove_from_region(region)
    assert (seen.tolist(), hidden.tolist(), undecided.tolist()) == ([0, 2], [1], [])
    assert sights.shape == (2, 2, 3)
    for start, end, box in zip(sights[:, 0], sights[:, 1], (WALL, BEHIND)):
        assert (start >= np.array(region[0]) - 1e-6).all() and (start <= np.array(region[1]) + 1e-6).all()
        assert (end >= np.array(box[0]) - 1e-4).all() and (end <= np.array(box[1]) + 1e-4).all()
    with pytest.raises(ValueError, match="region: the least corner"):
        street.seen_from_region(region[::-1])
    with pytest.raises(ValueError, match="clearance: NaN is not"):
        street.prove_from_region(region, clearance=np.nan)


@pytest.mark.parametrize("two_sided", [False, True])
def test_the_back_of_a_wall_hides_only_where_the_scene_says_so(two_sided):
    scene = Scene(two_sided=two_sided)
    # Its front is towards +x, where the lamp is.
    points = np.array([(5, -10, -10), (5, 10, -10), (5, 10, 10), (5, -10, 10)], dtype=np.float64)
    scene.add_mesh(points, [(0, 1, 2), (0, 2, 3)])
    scene.add_boxes([LAMP, BEHIND])
    back, front = [(-1, -1, -1), (0, 1, 1)], [(10, -1, -1), (11, 1, 1)]
    towards = View.perspective((12, 0, 0), (0, 0, 0))
    for joined in (False, True):
        if joined:
            scene.join_occluders()
        assert (1 in scene.cull(AHEAD)) == (not two_sided), f"{joined=}: past the back"
        assert 2 not in scene.cull(towards), f"{joined=}: behind the front"
    for region, beyond, is_hidden in ((back, 1, two_sided), (front, 2, True)):
        seen, hidden, undecided, _ = scene.prove_from_region(region)
        assert (beyond in hidden, beyond in seen) == (is_hidden, not is_hidden), f"{beyond} by proof"
        assert (beyond in scene.seen_from_region(region)) == (not is_hidden), f"{beyond} by the sweep"
        assert (beyond in scene.bake([region]).row(0)) == (not is_hidden), f"{beyond} in a bake"


def test_bake(street):
    cells = Scene.grid_cells([(-2, -2, -2), (2, 2, 2)], (2, 4, 4))
    assert cells.shape[1:] == (2, 3) and len(cells) >= 2
    baked = street.bake(cells)
    at = baked.locate([(-1.0, 0.5, 0.5), (1.0, 0.5, 0.5), (100.0, 0, 0)])
    assert at[0] >= 0 and at[1] >= 0 and at[2] == -1
    assert baked.row(at[0]).tolist() == [0, 2]
    again = BakedSet.from_bytes(baked.to_bytes())
    assert again.row(at[1]).tolist() == baked.row(at[1]).tolist() and len(again) == len(baked)
    with pytest.raises(ValueError, match="cell: 9999 is beyond"):
        baked.row(9999)
    with pytest.raises(ValueError, match="data: "):
        BakedSet.from_bytes(b"no set")
    with pytest.raises(ValueError, match="cells: row 0"):
        street.bake([WALL[::-1]])


def test_a_million_boxes():
    random = np.random.default_rng(3)
    low = random.uniform(-1000, 1000, (1_000_000, 3))
    scene = Scene()
    scene.add_boxes(np.stack([low, low + 1.0], axis=1), solid=False)
    seen = scene.cull(View.perspective((0, 0, 0), (1, 0, 0), far=100.0), mask=True)
    middle = low + 0.5
    # Certainly inside, and certainly outside, of the frustum of 1 radian by 16 / 9.
    ahead = middle[:, 0]
    up, side = np.tan(0.5) * ahead, np.tan(0.5) * ahead * 16 / 9
    inside = (ahead > 1) & (ahead < 98) & (np.abs(middle[:, 2]) < up) & (np.abs(middle[:, 1]) < side)
    outside = (ahead < -2) | (ahead > 102) | (np.abs(middle[:, 2]) > up + 3) | (np.abs(middle[:, 1]) > side + 5)
    assert seen[inside].all() and inside.sum() > 50
    assert not (seen & outside).any()


def test_threads_cull_one_scene_side_by_side():
    scene = Scene(origin=(300, 300, 0))
    scene.add_boxes(city(20))
    views = [View.perspective((300, 300, 1.7), (300 + np.cos(a), 300 + np.sin(a), 1.7)) for a in range(6)]
    alone = [scene.cull(view).tolist() for view in views]
    found = [None] * len(views)

    def work(number):
        found[number] = scene.cull(views[number]).tolist()

    threads = [threading.Thread(target=work, args=(number,)) for number in range(len(views))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == alone


def test_trimesh():
    trimesh = pytest.importorskip("trimesh")
    wall = trimesh.creation.box(bounds=WALL)
    source = trimesh.Scene()
    source.add_geometry(wall, node_name="wall")
    source.add_geometry(trimesh.creation.icosphere(radius=1.0), node_name="ball", transform=trimesh.transformations.translation_matrix((8, 0, 0)))
    scene = Scene.from_trimesh(source)
    assert scene.cull(AHEAD).tolist() == [0]
    assert scene.cull(AHEAD, occlusion=False).tolist() == [0, 1]
    assert len(Scene.from_trimesh(wall)) == 1


def test_trimesh_keeps_what_a_glb_says_of_sides_and_nodes():
    trimesh = pytest.importorskip("trimesh")
    square = [(0, -9, -9), (0, 9, -9), (0, 9, 9), (0, -9, 9)]
    source = trimesh.Scene()
    for name, double, extensions in [
        ("two-sided", True, {}),
        ("hidden", True, {"KHR_node_visibility": {"visible": False}}),
        ("moved", False, {"MSFT_lod": {"ids": [0]}}),
    ]:
        material = trimesh.visual.material.PBRMaterial(doubleSided=double)
        visual = trimesh.visual.TextureVisuals(material=material, uv=np.zeros((4, 2)))
        # It faces +x.
        mesh = trimesh.Trimesh(square, [(0, 1, 2), (0, 2, 3)], process=False, visual=visual)
        source.add_geometry(mesh, node_name=name)
        source.graph.update(frame_to=name, metadata={"gltf_extensions": extensions})
    glb = trimesh.load(io.BytesIO(source.export(file_type="glb")), file_type="glb")
    scene = Scene.from_trimesh(glb)
    lamp = scene.add_boxes([[(3, -0.5, -0.5), (4, 0.5, 0.5)]])[0]
    behind = View.perspective((-5, 0, 0), (0, 0, 0), fov_y=1.0)
    assert scene.cull(behind).tolist() == [0, 1] and lamp == 2
    _, hidden, _, _ = scene.prove_from_region([[-6, -1, -1], [-5, 1, 1]])
    assert hidden.tolist() == [lamp]


def test_trimesh_tells_whole_numbers_that_stand_for_parts_of_one():
    trimesh = pytest.importorskip("trimesh")
    # A wall as a writer of normalized whole numbers stores it, in a range that a longer mesh fills.
    wall = trimesh.creation.box(bounds=[(0, -3000, -9), (1, 3000, 9)])
    glb = trimesh.load(io.BytesIO(trimesh.Scene([wall]).export(file_type="glb")), file_type="glb")
    for source in [glb, glb.copy(), trimesh.Scene([mesh.copy() for mesh in glb.geometry.values()])]:
        scene = Scene.from_trimesh(source)
        lamp = scene.add_boxes([[(30, -1, -1), (31, 1, 1)]])[0]
        assert scene.cull(View.perspective((-30, 0, 0), (0, 0, 0), fov_y=1.0)).tolist() == [0, lamp]
    # What is no glTF file may be in millimetres.
    scene = Scene.from_trimesh(wall, origin=(0, 0, 0))
    scene.add_boxes([[(30, -1, -1), (31, 1, 1)]])
    assert scene.cull(View.perspective((-30, 0, 0), (0, 0, 0), fov_y=1.0)).tolist() == [0]


def house(low, high):
    """A CityJSON file of one house, with its vertices as integers of millimetres, and a wall with a window."""
    x0, y0, z0 = low
    x1, y1, z1 = high
    corners = [(x, y, z) for z in (z0, z1) for y in (y0, y1) for x in (x0, x1)]
    window = [(x0, y0 + 1, z0 + 1), (x0, y0 + 1, z0 + 2), (x0, y0 + 2, z0 + 2), (x0, y0 + 2, z0 + 1)]
    vertices = [[round(1000 * number) for number in point] for point in corners + window]
    faces = [[[0, 2, 3, 1]], [[4, 5, 7, 6]], [[0, 1, 5, 4]], [[3, 2, 6, 7]], [[1, 3, 7, 5]]]
    faces.append([[2, 0, 4, 6], [8, 9, 10, 11]])
    return {
        "type": "CityJSON",
        "version": "2.0",
        "transform": {"scale": [0.001] * 3, "translate": [0, 0, 0]},
        "vertices": vertices,
        "CityObjects": {
            "empty": {"type": "Building"},
            "house": {"type": "Building", "geometry": [{"type": "Solid", "lod": "2", "boundaries": [faces]}]},
        },
    }


def test_cityjson(tmp_path):
    pytest.importorskip("mapbox_earcut")
    path = tmp_path / "house.city.json"
    path.write_text(json.dumps(house((5, -10, -10), (6, 10, 10))))
    # The window is a hole in the front wall; the back wall is seen through it, from behind.
    view = View.perspective((0, -8.5, -8.5), (1, -8.5, -8.5), fov_y=0.05)
    for two_sided in (False, True):
        scene, names = Scene.from_cityjson(path, two_sided=two_sided)
        assert names == ["house"] and len(scene) == 1
        lamp = scene.add_boxes([[(8, -8.6, -8.6), (8.1, -8.4, -8.4)]])[0]
        assert lamp not in scene.cull(AHEAD)
        assert (lamp in scene.item_buffer(view)) == (not two_sided), "past the back of the back wall"
        assert (lamp in scene.cull(view)) == (not two_sided), "past the back of the back wall"
    with pytest.raises(ValueError, match="source: expected a CityJSON file"):
        Scene.from_cityjson({"type": "Feature"})


def test_ifc(tmp_path):
    pytest.importorskip("ifcopenshell")
    from ifcopenshell.api import run

    model = run("project.create_file")
    run("root.create_entity", model, ifc_class="IfcProject")
    run("unit.assign_unit", model, length={"is_metric": True, "raw": "METERS"})
    context = run("context.add_context", model, context_type="Model")
    named = {"context_type": "Model", "context_identifier": "Body", "target_view": "MODEL_VIEW"}
    body = run("context.add_context", model, parent=context, **named)
    for kind, at, size in (("IfcWall", 5.0, 8.0), ("IfcWindow", 3.0, 8.0), ("IfcFurniture", 8.0, 0.5)):
        product = run("root.create_entity", model, ifc_class=kind)
        sides = {"length": 0.5, "height": size, "thickness": size}
        shape = run("geometry.add_wall_representation", model, context=body, **sides)
        run("geometry.assign_representation", model, product=product, representation=shape)
        matrix = np.eye(4)
        matrix[:3, 3] = (at, -size / 2, -size / 2)
        run("geometry.edit_object_placement", model, product=product, matrix=matrix)
    path = tmp_path / "house.ifc"
    model.write(str(path))
    scene, names = Scene.from_ifc(path)
    assert sorted(model.by_guid(name).is_a() for name in names) == ["IfcFurniture", "IfcWall", "IfcWindow"]
    kinds = {model.by_guid(names[number]).is_a() for number in scene.cull(AHEAD)}
    assert kinds == {"IfcWall", "IfcWindow"}
    assert len(scene.cull(AHEAD, occlusion=False)) == 3


def packed(values, dtype):
    """The values as a field of packed records, as a view of bytes that is not aligned, and as given."""
    values = np.asarray(values, dtype=dtype)
    record = np.zeros(values.shape[0], dtype=[("id", "u1"), ("of", dtype, values.shape[1:])])
    record["of"] = values
    shifted = np.frombuffer(b"\0" + values.tobytes(), dtype, offset=1).reshape(values.shape)
    assert not record["of"].flags.aligned and not shifted.flags.aligned
    return [record["of"], shifted, values]


def test_any_layout_of_memory_gives_one_answer():
    boxes = [[[5, -1, -1], [6, 1, 1]], [[5, 3, -1], [6, 4, 1]]]
    view = View.perspective((0, 2, 0), (5, 2, 0))
    for given in packed(boxes, "f8"):
        scene = Scene()
        assert scene.add_boxes(given, solid=False).tolist() == [0, 1]
        assert scene.cull(view).tolist() == [0, 1]
    positions = [[5, -1, -1], [5, 1, -1], [5, 0, 1]]
    for points, triangles in zip(packed(positions, "f8"), packed([[0, 1, 2]], "u4")):
        scene = Scene()
        assert scene.add_mesh(points, triangles) == 0
        assert scene.cull(view).tolist() == [0]


def test_masked_numbers_are_refused():
    boxes = np.ma.masked_equal([[[5.0, -1, -1], [6, 1, 99]]], 99)
    with pytest.raises(ValueError, match="boxes.*masked"):
        Scene().add_boxes(boxes)
    assert Scene().add_boxes(np.ma.array([LAMP])).tolist() == [0], "nothing is masked"


def test_a_solid_box_hides_no_more_than_its_own_extent():
    far = 1e5  # where float32 has steps of 8 mm
    for edge, seen in [(0.0045, [0, 1]), (0.0075, [0, 1]), (20.0, [0])]:
        scene = Scene()
        scene.add_boxes([[[far - 50, 1, -50], [far + edge, 1.5, 50]]])
        scene.add_boxes([[[far + 5.2, 1000, -0.8], [far + 6.8, 1001, 0.8]]], solid=False)
        view = View.perspective((far, 0, 0), (far, 1, 0), fov_y=0.1, aspect=1.0, near=0.1)
        assert scene.cull(view).tolist() == seen, edge
    for thickness, seen in [(0.0, [0, 1]), (1e-9, [0, 1]), (1e-3, [0])]:
        scene = Scene()
        scene.add_boxes([[[0.1, -9, -9], [0.1 + thickness, 9, 9]]])
        scene.add_boxes([LAMP], solid=False)
        assert scene.cull(View.perspective((-5, 0, 0), (0, 0, 0))).tolist() == seen, thickness
