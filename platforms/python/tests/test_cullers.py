"""Cullers by name, cells with doors, and that none of them hides what pixels show."""

import threading

import numpy as np
import pytest
from visibility import Cells, Scene, View
from worlds import AHEAD, LAMP, WALL, city

NAMES = ["z_buffer", "horizon", "occlusion_tree"]


def street_views(count=5, seed=2):
    random = np.random.default_rng(seed)
    for _ in range(count):
        block = random.integers(2, 18, 2) * 30.0
        yield View.perspective((*block, 1.7), (*(block + random.normal(0, 1, 2)), 1.7))


def missed(scene, view, ids):
    """Objects that a pixel shows and that are not among ids."""
    return scene.compare(view, ids)[0].tolist()


@pytest.fixture(scope="module")
def town():
    scene = Scene(origin=(300, 300, 0))
    scene.add_boxes(city(20))
    return scene


@pytest.mark.parametrize("name", NAMES)
def test_each_culler_hides_a_town_and_nothing_that_shows(town, name):
    for frame, view in enumerate(street_views()):
        in_view, ids = town.cull(view, occlusion=False), town.cull(view, occlusion=name)
        assert len(ids) * 2 < len(in_view), f"{name}, frame {frame}: {len(ids)} of {len(in_view)} are left"
        assert missed(town, view, ids) == [], f"{name}, frame {frame}"
        assert town.cull(view, occlusion=name, mask=True).nonzero()[0].tolist() == ids.tolist()


def test_cullers_apply_in_turn(town):
    for view in street_views():
        alone = [set(town.cull(view, occlusion=name)) for name in NAMES]
        together = set(town.cull(view, occlusion=NAMES))
        assert all(together <= own for own in alone)
        assert missed(town, view, sorted(together)) == []
        assert set(town.cull(view, occlusion=[])) == set(town.cull(view, occlusion=False))
        assert set(town.cull(view, occlusion=True)) == set(town.cull(view)) == alone[0]
        assert set(town.cull(view, occlusion=None)) == alone[0]


def test_the_horizon_has_an_axis():
    # A town whose y axis is up.
    scene = Scene(origin=(300, 0, 300))
    scene.add_boxes(city(20)[:, :, [0, 2, 1]])
    hidden = {}
    random = np.random.default_rng(2)
    for frame in range(3):
        x, z = random.integers(2, 18, 2) * 30.0
        dx, dz = random.normal(0, 1, 2)
        view = View.perspective((x, 1.7, z), (x + dx, 1.7, z + dz), up=(0, 1, 0))
        in_view = scene.cull(view, occlusion=False)
        for name in ("horizon", "horizon_y"):
            ids = scene.cull(view, occlusion=name)
            assert missed(scene, view, ids) == [], f"{name}, frame {frame}"
            hidden[name] = hidden.get(name, 0) + len(in_view) - len(ids)
    # Houses are solids along any axis, and have roofs along one.
    assert hidden["horizon_y"] > hidden["horizon"] > 0, hidden


@pytest.mark.parametrize("name", NAMES)
def test_what_is_added_and_moved_between_calls_counts(name):
    scene = Scene()
    lamp = scene.add_boxes([LAMP], solid=False)
    assert scene.cull(AHEAD, occlusion=name).tolist() == [0]
    scene.add_boxes([WALL])
    assert scene.cull(AHEAD, occlusion=name).tolist() == [1], "behind a new wall"
    scene.move_boxes(lamp, np.array([LAMP]) - (6, 0, 0))
    assert scene.cull(AHEAD, occlusion=name).tolist() == [0, 1], "before the wall"
    scene.move_boxes(lamp, [LAMP])
    assert scene.cull(AHEAD, occlusion=name).tolist() == [1], "behind it again"
    other = scene.add_boxes([np.array(LAMP) + (0.5, 0, 0), np.array(LAMP) - (5, 0, 0)], solid=False)
    assert scene.cull(AHEAD, occlusion=name).tolist() == [1, other[1]], "new ones"


@pytest.mark.parametrize("name", NAMES)
def test_walls_hide_after_more_changes_than_are_listed(name):
    scene = Scene()
    scene.add_boxes([WALL, LAMP])
    crowd = scene.add_boxes([np.array(LAMP) + (0, 50 + i, 0) for i in range(2000)], solid=False)
    assert scene.cull(AHEAD, occlusion=name).tolist() == [0]
    for step in range(40):
        scene.move_boxes(crowd, scene.bounds[crowd] + (0, 0.5, 0))
    assert scene.cull(AHEAD, occlusion=name).tolist() == [0]


def test_threads_cull_with_several_cullers(town):
    views = list(street_views(4))
    alone = [[town.cull(view, occlusion=name).tolist() for name in NAMES] for view in views]
    found = [None] * len(views)

    def work(number):
        found[number] = [town.cull(views[number], occlusion=name).tolist() for name in NAMES]

    threads = [threading.Thread(target=work, args=(number,)) for number in range(len(views))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == alone


ROOMS = [[(0, 0, 0), (4, 4, 3)], [(4, 0, 0), (8, 4, 3)], [(8, 0, 0), (12, 4, 3)]]
DOORS = [
    np.array([(4, 1, 0), (4, 2, 0), (4, 2, 2), (4, 1, 2)], dtype=np.float64),
    np.array([(8, 3, 0), (8, 3.9, 0), (8, 3.9, 2), (8, 3, 2)], dtype=np.float64),
]
JOINS = [(0, 1), (1, 2)]
# In the first room; beyond the first door; in the second room beside the door; in the third.
THINGS = [[(2, 1.4, 1), (2.2, 1.6, 1.2)], [(6, 1.4, 1), (6.2, 1.6, 1.2)], [(4.2, 3.5, 1), (4.4, 3.7, 1.2)], [(9, 1.4, 1), (9.2, 1.6, 1.2)]]
INDOORS = View.perspective((0.5, 1.5, 1.1), (5, 1.5, 1.1))


def rooms():
    scene = Scene()
    scene.add_boxes(THINGS, solid=False)
    return scene, Cells(ROOMS, DOORS, JOINS)


def test_cells_hide_what_is_not_seen_through_doors():
    scene, cells = rooms()
    assert len(cells) == 3 and repr(cells) == "Cells(3 cells, 2 portals)"
    assert scene.cull(INDOORS, occlusion=False).tolist() == [0, 1, 2, 3]
    assert scene.cull(INDOORS, occlusion=cells).tolist() == [0, 1]
    assert scene.cull(INDOORS, occlusion=[cells, "z_buffer"]).tolist() == [0, 1]
    cells.set_open(0, False)
    assert scene.cull(INDOORS, occlusion=cells).tolist() == [0], "a closed door"
    cells.set_open(0, True)
    for passage, seen in (("forward", [0, 1]), ("backward", [0]), ("both", [0, 1])):
        cells.set_passage(0, passage)
        assert scene.cull(INDOORS, occlusion=cells).tolist() == seen, passage
    # Outside of all cells nothing is known.
    outside = View.perspective((-5, 1.5, 1.1), (5, 1.5, 1.1))
    assert scene.cull(outside, occlusion=cells).tolist() == scene.cull(outside, occlusion=False).tolist()


def test_each_cells_answer_for_themselves():
    scene, cells = rooms()
    closed = Cells(ROOMS, DOORS, JOINS)
    closed.set_open(0, False)
    for _ in range(2):
        assert scene.cull(INDOORS, occlusion=cells).tolist() == [0, 1]
        assert scene.cull(INDOORS, occlusion=closed).tolist() == [0]
        assert scene.cull(INDOORS, occlusion=[cells, closed]).tolist() == [0]
    # More than are kept.
    for _ in range(100):
        assert scene.cull(INDOORS, occlusion=Cells(ROOMS, DOORS, JOINS)).tolist() == [0, 1]


def test_what_cells_tell():
    _, cells = rooms()
    assert cells.joins.tolist() == [[0, 1], [1, 2]] and cells.joins.dtype == np.uint32
    assert [len(corners) for corners in cells.portals] == [4, 4]
    assert {tuple(corner) for corner in cells.portals[1]} == {tuple(corner) for corner in DOORS[1]}
    assert cells.locate([(1, 1, 1), (5, 1, 1), (9, 1, 1), (0, 0, 9), (np.nan, 0, 0)]).tolist() == [0, 1, 2, -1, -1]
    assert cells.sees([0, 0, 2], [1, 2, 0]).tolist() == [True, True, True]
    cells.set_open(1, False)
    assert cells.sees([0, 0, 2, 2], [1, 2, 0, 2]).tolist() == [True, False, False, True]
    cells.set_open(1, True)
    cells.set_passage(1, "forward")
    assert cells.sees([0, 2], [2, 0]).tolist() == [True, False]


def test_a_portal_file_of_a_map_compiler():
    lines = ["PRT1", "3", "2"]
    for (a, b), corners in zip(JOINS, DOORS):
        points = " ".join("({} {} {})".format(*corner) for corner in corners)
        lines.append(f"{len(corners)} {a} {b} {points}")
    count, portals, joins = Cells.read_prt("\n".join(lines) + "\n")
    assert (count, joins.tolist()) == (3, [list(pair) for pair in JOINS])
    for portal, corners in zip(portals, DOORS):
        assert {tuple(corner) for corner in portal} == {tuple(corner) for corner in corners}
    scene, _ = rooms()
    assert scene.cull(INDOORS, occlusion=Cells(ROOMS, portals, joins)).tolist() == [0, 1]


def test_a_bake_of_cells_finds_what_no_line_reaches():
    # A corridor whose last part leads back along the first: no line leads from one to the other.
    boxes = [[(0, 0, 0), (8, 2, 2)], [(8, 0, 0), (10, 12, 2)], [(0, 10, 0), (8, 12, 2)]]
    portals = [[(8, 0, 0), (8, 2, 0), (8, 2, 2), (8, 0, 2)], [(8, 10, 0), (8, 12, 0), (8, 12, 2), (8, 10, 2)]]
    cells = Cells(boxes, portals, JOINS)
    assert cells.sees([0, 0], [1, 2]).tolist() == [True, True], "a chain of portals"
    cells.bake()
    assert cells.sees([0, 0, 2], [1, 2, 0]).tolist() == [True, False, False]
    scene = Scene()
    scene.add_boxes([[(9, 1, 1), (9.1, 1.1, 1.1)], [(7, 10.5, 1), (7.1, 10.6, 1.1)]], solid=False)
    view = View.perspective((1, 1, 1), (9, 1, 1), fov_y=2.0)
    assert scene.cull(view, occlusion=False).tolist() == [0, 1]
    assert scene.cull(view, occlusion=cells).tolist() == [0]


def test_cells_that_are_cut_by_planes():
    # The second room is cut by the plane x + y = 9.
    planes = [np.zeros((0, 4)), np.array([(-1.0, -1.0, 0.0, 9.0)]), np.zeros((0, 4))]
    cells = Cells(ROOMS, DOORS, JOINS, planes=planes)
    assert cells.locate([(4.5, 3, 1), (7, 3, 1)]).tolist() == [1, -1]


def house(open_door, two_sided=True):
    """A scene of two rooms of walls, floor and ceiling, with a door between them, and things in each."""
    scene = Scene(two_sided=two_sided)

    def quad(*corners):
        scene.add_mesh(np.array(corners, dtype=np.float64), [(0, 1, 2), (0, 2, 3)])

    for z in (0, 3):
        quad((0, 0, z), (8, 0, z), (8, 4, z), (0, 4, z))
    for y in (0, 4):
        quad((0, y, 0), (8, y, 0), (8, y, 3), (0, y, 3))
    for x in (0, 8):
        quad((x, 0, 0), (x, 4, 0), (x, 4, 3), (x, 0, 3))
    quad((4, 0, 0), (4, 1, 0), (4, 1, 3), (4, 0, 3))
    quad((4, 2, 0), (4, 4, 0), (4, 4, 3), (4, 2, 3))
    quad((4, 1, 2), (4, 2, 2), (4, 2, 3), (4, 1, 3))
    if not open_door:
        quad((4, 1, 0), (4, 2, 0), (4, 2, 2), (4, 1, 2))
    walls = len(scene)
    scene.add_boxes(THINGS[:3] + [[(20, 1, 1), (21, 2, 2)]])
    return scene, walls


@pytest.mark.parametrize("open_door", [True, False])
def test_cells_made_of_walls(open_door):
    scene, walls = house(open_door)
    cells = scene.make_cells()
    assert len(cells) >= 3
    left, right = cells.locate([(1, 2.5, 1), (7, 2.5, 1)])
    assert left >= 0 and right >= 0 and left != right
    assert cells.sees([left], [right]).tolist() == [open_door]
    ids = scene.cull(INDOORS, occlusion=cells)
    assert (set(ids) & set(range(walls, len(scene)))) == ({walls, walls + 1} if open_door else {walls})
    assert missed(scene, INDOORS, ids) == []
    assert len(scene.make_cells(max_cells=1)) <= 1


def test_walls_that_show_from_one_side_make_no_cells_that_hide_past_their_backs():
    scene, walls = house(open_door=False, two_sided=False)
    cells = scene.make_cells()
    shown = set()
    for eye, target in [((1, 3, 1.1), (5, 3.6, 1.1)), ((7, 3.5, 1.1), (2, 1.5, 1.1))]:
        view = View.perspective(eye, target)
        shown |= set(np.unique(scene.item_buffer(view))) - {-1}
        assert missed(scene, view, scene.cull(view, occlusion=cells)) == [], eye
    assert shown & {walls, walls + 1, walls + 2}, "something shows past the back of a wall"


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: Scene().cull(AHEAD, occlusion="zbuffer"), "occlusion: 'zbuffer' is not z_buffer, horizon"),
        (lambda: Scene().cull(AHEAD, occlusion=["horizon", 3]), "occlusion: 3 is not z_buffer"),
        (lambda: Scene().cull(AHEAD, occlusion=7), "occlusion: 7 is not z_buffer"),
        (lambda: Cells.read_prt("PRT1\n2\n1\n4 0 1 (0 0 0) (0 1 0)\n"), "text: "),
        (lambda: Cells(ROOMS, DOORS, JOINS[:1]), "joins: expected (2, 2), as portals, got (1, 2)"),
        (lambda: Cells(ROOMS[:2], DOORS, JOINS), "portals: "),
        (lambda: Cells(ROOMS, DOORS, [(0, 0), (1, 2)]), "portals: "),
        (lambda: Cells(ROOMS, [DOORS[0], DOORS[1][:2]], JOINS), "portals: "),
        (lambda: Cells(ROOMS, DOORS, JOINS, tolerance=-1.0), "boxes: "),
        (lambda: Cells(ROOMS, DOORS, JOINS, planes=[np.zeros((0, 4))]), "planes: expected 3 arrays, as boxes, got 1"),
        (lambda: Cells(ROOMS, DOORS, JOINS, planes=[np.zeros((1, 3))] * 3), "planes: expected (k, 4) float64"),
        (lambda: Cells(ROOMS, DOORS, JOINS).set_open(2, True), "portal: "),
        (lambda: Cells(ROOMS, DOORS, JOINS).set_passage(0, "in"), 'passage: "in" is not both, forward or backward'),
        (lambda: Cells(ROOMS, DOORS, JOINS).sees([0], [3]), "b: 3 is beyond the 3 cells"),
        (lambda: Cells(ROOMS, DOORS, JOINS).sees([0, 1], [1]), "b: expected (2,), as a, got (1,)"),
    ],
)
def test_wrong_arguments_are_named(call, message):
    with pytest.raises(ValueError) as error:
        call()
    assert message in str(error.value)
