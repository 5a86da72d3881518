"""What is refused, and in which words. No argument may panic."""

import inspect

import numpy as np
import pytest
import visibility
from visibility import BakedSet, Plan, Scene, View

POINTS = np.zeros((4, 2), dtype=np.float32)

REFUSALS = [
    (lambda: Scene().add_mesh(POINTS, [(0, 1, 2)]), "positions: expected (n, 3) float64, got (4, 2) float32"),
    (lambda: Scene().add_mesh(np.zeros((4, 2)), [(0, 1, 2)]), "positions: expected (n, 3) float64, got (4, 2) float64"),
    (lambda: Scene().add_mesh(np.zeros((3, 3)), np.zeros((1, 3))), "triangles: expected (n, 3) uint32, got (1, 3) float64"),
    (lambda: Scene().add_mesh(np.zeros((3, 3)), [(0, 1, 3)]), "triangles: row 0 has an index beyond the 3 positions"),
    (lambda: Scene().add_mesh(np.zeros((3, 3)), [(0, 1, -1)]), "triangles: -1 is no index"),
    (lambda: Scene().add_mesh(np.zeros((3, 3)), np.array([[0, 1, 2**40]])), "triangles: 1099511627776 is no index"),
    (lambda: Scene().add_mesh(np.zeros((3, 3)), np.zeros((0, 3), int)), "triangles: there are none"),
    (lambda: Scene().add_mesh(np.full((3, 3), np.nan), [(0, 1, 2)]), "positions: row 0 is not finite"),
    (lambda: Scene().add_boxes(np.zeros((2, 6))), "boxes: expected (n, 2, 3) float64, got (2, 6) float64"),
    (lambda: Scene().add_boxes("boxes"), "boxes: expected (n, 2, 3) float64, got str"),
    (lambda: Scene().add_boxes(None), "boxes: expected (n, 2, 3) float64, got () float64"),
    (lambda: Scene().move_boxes([0], [[(0, 0, 0), (1, 1, 1)]]), "ids: no object has the number 0"),
    (lambda: Scene().move_boxes([0], np.zeros((2, 2, 3))), "boxes: expected (1, 2, 3), as ids, got (2, 2, 3)"),
    (lambda: Scene(origin=(np.nan, 0, 0)), "origin: "),
    (lambda: View.perspective((0, 0, 0), (1, 0, 0), fov_y=4.0), "fov_y: "),
    (lambda: View.perspective((np.inf, 0, 0), (1, 0, 0)), "eye: "),
    (lambda: View.orthographic((0, 0, 0), (1, 0, 0), -1.0, 1.0), "width: "),
    (lambda: View.from_matrix(np.zeros((4, 4))), "matrix: the clip matrix is singular"),
    (lambda: View.from_matrix(np.eye(3)), "matrix: expected (4, 4) float64, got (3, 3) float64"),
    (lambda: View.from_matrix(np.eye(4), depth="gl"), 'depth: "gl" is not'),
    (lambda: Scene().item_buffer(View.perspective((0, 0, 0), (1, 0, 0)), size=(0, 9)), "size: "),
    (lambda: Scene().compare(View.perspective((0, 0, 0), (1, 0, 0)), [7]), "ids: no object has the number 7"),
    (lambda: Scene.grid_cells([(0, 0, 0), (1, 1, 1)], (0, 1, 1)), "size: "),
    (lambda: Plan(np.zeros((3, 4))), "walls: expected (n, 2, 2) float64, got (3, 4) float64"),
    (lambda: Plan([[(0, 0), (np.nan, 1)]]), "walls: point"),
    (lambda: Plan([[(0, 0), (1, 1)]]).sees(POINTS, POINTS), "a: expected (n, 2) float64, got (4, 2) float32"),
    (lambda: Plan([[(0, 0), (1, 1)]]).sees(np.zeros((2, 2)), np.zeros((3, 2))), "b: expected (2, 2), as a, got (3, 2)"),
    (lambda: Plan([[(0, 0), (1, 1)]]).sees([(0, 0)], [(np.inf, 0)]), "b: row 0: point"),
    (lambda: Plan([[(0, 0), (1, 1)]]).visibility_polygon((np.nan, 0)), "eye: point"),
    (lambda: Plan.from_polygons([[(0, 0, 0), (1, 1, 1)]]), "polygons: expected rings (n, 2), got (2, 3)"),
    (lambda: visibility.viewshed(np.zeros(4), (0, 0)), "heights: expected (rows, columns) float64, got (4,) float64"),
    (lambda: visibility.viewshed(np.zeros((2, 2), dtype=np.int64), (0, 0)), "heights: expected (rows, columns) float64, float32 or int16, got (2, 2) int64"),
    (lambda: visibility.viewshed(np.zeros((2, 2)), (0, 5)), "observer: the observer at row 0.0, column 5.0 is not over"),
    (lambda: visibility.viewshed(np.zeros((2, 2)), (0, 0), cell_size=0.0), "cell_size: "),
    (lambda: visibility.viewshed(np.zeros((2, 2)), (0, 0), max_distance=-1.0), "max_distance: "),
    (lambda: visibility.viewshed(np.zeros((2, 2)), (0, 0), observer_height=-1.0), "observer_height, target_height or curvature: "),
    (lambda: visibility.viewshed(np.zeros((0, 3)), (0, 0)), "heights: 0 values for 0 rows of 3 samples"),
    (lambda: visibility.viewshed_count(np.zeros((2, 2)), [(0, 0, 0)]), "observers: expected (n, 2) float64, got (1, 3) float64"),
]


@pytest.mark.parametrize("number", range(len(REFUSALS)))
def test_refused_by_name(number):
    call, message = REFUSALS[number]
    with pytest.raises(ValueError) as refused:
        call()
    assert any(str(refused.value).startswith(start) for start in message.split("|")), str(refused.value)


NUMBERS = [0.0, -0.0, 1.0, -1.0, 1e-320, 1e30, -1e60, 1e308, np.inf, -np.inf, np.nan]


def test_hostile_numbers_never_panic():
    random = np.random.default_rng(1)

    def some(*shape):
        return random.choice(NUMBERS, shape)

    def tried(call, *arguments, **named):
        try:
            return call(*arguments, **named)
        except (ValueError, TypeError):
            return None

    done = 0
    for _ in range(300):
        plan = tried(Plan, some(random.integers(0, 6), 2, 2))
        if plan:
            for query in (plan.visible_areas, plan.seen_from_region, plan.guards, plan.unseen):
                tried(query, some(3, 2))
            tried(plan.rays, some(3, 2), some(3, 2))
            tried(plan.shortest_path, some(2), some(2))
            tried(plan.visibility_polygon, some(2), range=some(1)[0], sector=(some(2), some(2)))
        scene = tried(Scene, origin=some(3)) or Scene()
        tried(scene.add_boxes, some(3, 2, 3), solid=bool(random.integers(2)))
        tried(scene.add_mesh, some(4, 3), random.integers(0, 4, (3, 3)))
        view = tried(View.perspective, some(3), some(3), up=some(3)) or tried(View.from_matrix, some(4, 4))
        if view:
            done += 1
            tried(scene.cull, view)
            tried(scene.item_buffer, view, size=(16, 9))
        tried(scene.seen_from_region, some(2, 3))
        tried(scene.prove_from_region, some(2, 3))
        tried(visibility.viewshed, some(3, 4), some(2), cell_size=some(1)[0], curvature=some(1)[0])
        tried(visibility.hidden_heights, some(3, 4), (1.0, 1.0), curvature=some(1)[0])
    assert done > 3
    for length in range(40):
        tried(BakedSet.from_bytes, random.bytes(length))


def test_signatures_can_be_read():
    assert inspect.signature(visibility.viewshed).parameters["max_distance"].default == np.inf
    for kind in (Plan, Scene, View, BakedSet, visibility.UnseenRegion):
        for name in dir(kind):
            if not name.startswith("_") and callable(getattr(kind, name)):
                assert getattr(kind, name).__doc__, f"{kind.__name__}.{name} is documented"
                inspect.signature(getattr(kind, name))
    for name in ("viewshed_count", "hidden_heights"):
        assert "observer_height" in inspect.signature(getattr(visibility, name)).parameters
