"""Plans: polygons, segments, guards and paths, against shapely-free arithmetic of their own."""

import numpy as np
import pytest
from visibility import Plan


def square(low, high):
    return [(low, low), (high, low), (high, high), (low, high)]


@pytest.fixture
def ring():
    """A square room of 10 m with a square pillar of 2 m in its middle."""
    return Plan.from_polygons([square(0.0, 10.0), square(4.0, 6.0)])


def area(polygon):
    x, y = polygon.T
    return 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)


def test_polygon_of_an_empty_room_is_the_room():
    plan = Plan.from_polygons([square(0.0, 4.0)])
    polygon = plan.visibility_polygon((1.0, 2.0))
    assert polygon.dtype == np.float64
    assert sorted(map(tuple, polygon)) == [(0, 0), (0, 4), (4, 0), (4, 4)]
    assert area(polygon) == pytest.approx(16.0)


def test_pillar_casts_its_shadow(ring):
    # 3 m before the pillar, whose near corners are at 4, 4 and 4, 6. Pillar and shadow are the trapezium from x = 4
    # to 10 between lines of slope 1 / 3.
    shadow = 6.0 * (2.0 + 6.0) / 2.0
    assert area(ring.visibility_polygon((1.0, 5.0))) == pytest.approx(100.0 - shadow)
    assert ring.visible_areas([(1.0, 5.0)]) == pytest.approx([100.0 - shadow])
    assert list(ring.visible_walls((1.0, 5.0))) == [0, 1, 2, 3, 7]


def test_range_and_sector(ring):
    eye = (2.0, 2.0)
    near = ring.visibility_polygon(eye, range=1.0)
    assert np.hypot(*(near - eye).T).max() <= 1.0 + 1e-9
    assert 3.1 < area(near) <= np.pi
    part = ring.visibility_polygon(eye, range=1.0, sector=((3.0, 2.0), (2.0, 3.0)))
    assert (part >= np.array(eye) - 1e-12).all()
    assert area(part) == pytest.approx(np.pi / 4, rel=0.01)


def crosses(p, q, a, b):
    """Whether segments properly cross."""

    def side(u, v, w):
        return (v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0])

    return side(p, q, a) * side(p, q, b) < 0 and side(a, b, p) * side(a, b, q) < 0


def test_a_million_segments_agree_with_arithmetic(ring):
    random = np.random.default_rng(1)
    a, b = random.uniform(0.1, 9.9, (2, 1_000_000, 2))
    seen = ring.sees(a, b)
    assert seen.shape == (1_000_000,) and seen.dtype == np.bool_
    for number in range(500):
        blocked = any(crosses(a[number], b[number], *wall) for wall in ring.walls)
        assert seen[number] == (not blocked), f"segment {number}"
    assert 0 < seen[:500].sum() < 500


def test_rays_meet_the_nearest_wall(ring):
    points, walls = ring.rays([(1.0, 5.0), (1.0, 1.0), (1.0, 5.0)], [(2.0, 5.0), (1.0, 0.5), (1.0, 5.0)])
    assert points[:2].tolist() == [[4.0, 5.0], [1.0, 0.0]]
    assert walls.tolist() == [7, 0, -1]
    assert np.isnan(points[2]).all()


def test_doors_open(ring):
    assert not ring.sees([(1.0, 5.0)], [(9.0, 5.0)])[0]
    for wall in range(4, 8):
        ring.set_opacity(wall, "clear")
    assert ring.sees([(1.0, 5.0)], [(9.0, 5.0)])[0]
    with pytest.raises(ValueError, match="wall 8 is unknown"):
        ring.set_opacity(8, "clear")
    with pytest.raises(ValueError, match='opacity: "open" is not'):
        ring.set_opacity(0, "open")


def test_region_sees_what_its_points_see(ring):
    walls, triangles = ring.seen_from_region([(1.0, 4.0), (1.0, 6.0), (2.0, 5.0)])
    assert walls.tolist() == [0, 1, 2, 3, 7]
    assert triangles.shape[1:] == (3, 2)


def test_guards_see_all(ring):
    guards, witnesses = ring.guards([(1.0, 1.0)])
    assert 2 <= len(guards) <= 4 and 1 <= len(witnesses) <= len(guards)
    unseen = ring.unseen([(1.0, 1.0)])
    assert unseen.area == pytest.approx(96.0)
    gains = unseen.gains(guards)
    before = unseen.copy()
    for guard in guards:
        unseen.look(guard)
    assert unseen.area == pytest.approx(0.0, abs=1e-9)
    assert before.area == pytest.approx(96.0)
    # What a first guard takes away is what it sees.
    assert gains == pytest.approx(ring.visible_areas(guards))
    assert before.contains([(1.0, 1.0), (5.0, 5.0)]).tolist() == [True, False]
    assert sum(abs(area(polygon)) for polygon in before.polygons()) == pytest.approx(96.0)


def test_path_around_the_pillar(ring):
    path = ring.shortest_path((1.0, 5.0), (9.0, 5.0))
    assert path[[0, -1]].tolist() == [[1.0, 5.0], [9.0, 5.0]]
    length = np.hypot(*np.diff(path, axis=0).T).sum()
    assert length == pytest.approx(2 * np.hypot(3.0, 1.0) + 2.0)
    assert ring.shortest_path((1.0, 5.0), (5.0, 5.0)) is None


def test_shapely():
    shapely = pytest.importorskip("shapely")
    room = shapely.Polygon(square(0, 10), [square(4, 6)])
    plan = Plan.from_shapely(shapely.GeometryCollection([room, shapely.LineString([(0, 8), (3, 8)])]))
    assert len(plan) == 9
    seen = shapely.Polygon(plan.visibility_polygon((1.0, 5.0)))
    assert room.buffer(1e-9).contains(seen)
    with pytest.raises(ValueError, match="a Point has no walls"):
        Plan.from_shapely(shapely.Point(0, 0))


def test_walls_of_packed_records():
    walls = np.array([[[2.0, -1], [2, 1]], [[-3, -3], [3, -3]]])
    record = np.zeros(2, dtype=[("id", "u1"), ("ends", "f8", (2, 2))])
    record["ends"] = walls
    shifted = np.frombuffer(b"\0" + walls.tobytes(), walls.dtype, offset=1).reshape(walls.shape)
    for given in [record["ends"], shifted, walls]:
        plan = Plan(given)
        assert plan.sees([(0.0, 0.0)] * 2, [(4.0, 0.0), (1.0, 0.0)]).tolist() == [False, True]
