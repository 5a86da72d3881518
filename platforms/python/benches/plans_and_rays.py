"""Plans beside loops over shapely, VisiLibity and CGAL, and cameras beside trimesh.ray, on the same walls and houses in one
run.

Usage: python plans_and_rays.py, with shapely, trimesh, rtree and embreex installed. Rows of VisiLibity and of CGAL are left
out where their packages are not there: `pip install pyvispoly`, and `pip install swig wheel setuptools` before `pip install
--no-build-isolation visilibity`, with swig on the path; it compiles for two minutes. Times are of the processor, of one
thread, the least of three runs.
"""

import time

import numpy as np
import shapely
import trimesh
from visibility import Plan, Scene, View

random = np.random.default_rng(5)


def least(call, times=3):
    """Returns the least time of the processor in seconds, and the last result."""
    best = np.inf
    for _ in range(times):
        start = time.process_time()
        result = call()
        best = min(best, time.process_time() - start)
    return best, result


def row(what, ours, theirs, note):
    print(f"| {what} | {1e3 * ours:.3g} ms | {1e3 * theirs:.3g} ms | {theirs / ours:.0f} | {note} |")


def streets(side):
    """Returns houses (n, 2, 3) on a grid of side x side lots, with streets between them."""
    x, y = np.meshgrid(np.arange(side) * 20.0, np.arange(side) * 20.0)
    low = np.column_stack([x.ravel(), y.ravel(), np.zeros(side * side)]) + random.uniform(0, 3, (side * side, 3)) * (1, 1, 0)
    return np.stack([low, low + random.uniform((8, 8, 5), (14, 14, 30), (side * side, 3))], axis=1)


def rings(houses):
    return [[(a[0], a[1]), (b[0], a[1]), (b[0], b[1]), (a[0], b[1])] for a, b in houses]


def outside(houses, count, size):
    """Returns points (count, 2) that are in no house."""
    points = random.uniform(-5, size, (20 * count, 2))
    inside = ((houses[:, 0, None, :2] <= points) & (points <= houses[:, 1, None, :2])).all(axis=2).any(axis=0)
    return points[~inside][:count]


def by_rays(walls, tree, eye, corners, reach):
    """The visibility polygon as people write it: rays beside each corner, cut by shapely at the nearest wall."""
    angles = np.arctan2(*(corners - eye).T[::-1])
    angles = np.unique(np.concatenate([angles - 1e-7, angles, angles + 1e-7]))
    start, points = shapely.Point(eye), []
    for angle in angles:
        ray = shapely.LineString([eye, eye + reach * np.array([np.cos(angle), np.sin(angle)])])
        hits = shapely.intersection(ray, walls[tree.query(ray, predicate="intersects")])
        near = [p for hit in hits for p in shapely.get_coordinates(hit)] or [ray.coords[1]]
        points.append(min(near, key=lambda p: start.distance(shapely.Point(p))))
    return shapely.Polygon(points)


def by_visilibity(rings):
    """Returns a function that gives visibility polygons of outlines, the outer one first, by VisiLibity."""
    import visilibity

    def polygon(ring):
        return visilibity.Polygon([visilibity.Point(*map(float, point)) for point in ring])

    # The outer outline is counter-clockwise, and holes are clockwise.
    environment = visilibity.Environment([polygon(rings[0]), *(polygon(ring[::-1]) for ring in rings[1:])])
    assert environment.is_valid(1e-9)
    return lambda eye: visilibity.Visibility_Polygon(visilibity.Point(*map(float, eye)), environment, 1e-9)


def by_cgal(rings):
    """The same by CGAL, with exact numbers."""
    import pyvispoly

    def point(place):
        return pyvispoly.Point(*(pyvispoly.FieldNumber(float(number)) for number in place))

    turned = [rings[0], *(ring[::-1] for ring in rings[1:])]
    outer, *holes = [pyvispoly.Polygon([point(place) for place in ring]) for ring in turned]
    calculator = pyvispoly.VisibilityPolygonCalculator(pyvispoly.PolygonWithHoles(outer, holes))
    return lambda eye: calculator.compute_visibility_polygon(point(eye))


print("| what | visibility | the other | times as long | answers |")
print("|---|---:|---:|---:|---|")
houses = streets(20)
plan = Plan.from_polygons([[(-10, -10), (410, -10), (410, 410), (-10, 410)], *rings(houses)])
walls = shapely.linestrings(plan.walls)
tree = shapely.STRtree(walls)

a, b = outside(houses, 20000, 400), outside(houses, 20000, 400)
b = np.where(random.random((len(a), 1)) < 0.5, b, a + random.uniform(-20, 20, a.shape))
ours, seen = least(lambda: plan.sees(a, b))
few = 2000
theirs, loop = least(lambda: np.array([len(tree.query(shapely.LineString(ends), "intersects")) == 0 for ends in np.stack([a, b], 1)[:few]]), 1)
row("20,000 lines of sight among 1,604 walls; shapely's tree in a loop", ours, theirs * len(a) / few, f"{(loop != seen[:few]).sum()} of {few} differ")


def at_once():
    clear = np.ones(len(a), bool)
    clear[tree.query(shapely.linestrings(np.stack([a, b], 1)), "intersects")[0]] = False
    return clear


theirs, clear = least(at_once)
row("the same; shapely's tree, all at once", ours, theirs, f"{(clear != seen).sum()} of {len(a)} differ")

small = streets(6)
outlines = [[(-10, -10), (130, -10), (130, 130), (-10, 130)], *rings(small)]
town = Plan.from_polygons(outlines)
eyes = outside(small, 10, 120)
lines = shapely.linestrings(town.walls)
town_tree, corners = shapely.STRtree(lines), town.walls.reshape(-1, 2)
ours, areas = least(lambda: np.array([shapely.Polygon(town.visibility_polygon(eye)).area for eye in eyes]))
theirs, others = least(lambda: np.array([by_rays(lines, town_tree, eye, corners, 300.0).area for eye in eyes]), 1)
row("10 visibility polygons among 148 walls; rays beside corners, by shapely", ours, theirs, f"areas differ by at most {np.abs(others / areas - 1).max():.1e}")
for name, make in ("VisiLibity", by_visilibity), ("CGAL (pyvispoly)", by_cgal):
    try:
        look = make(outlines)
    except ImportError:
        continue
    theirs, others = least(lambda: np.array([float(look(eye).area()) for eye in eyes]))
    row(f"the same; {name}", ours, theirs, f"areas differ by at most {np.abs(others / areas - 1).max():.1e}")

scene, meshes = Scene(origin=(200, 200, 0)), []
ground = np.array([[(-50, -50, -1), (450, 450, 0)]], float)
scene.add_boxes(np.concatenate([ground, houses]))
for low, high in np.concatenate([ground, houses]):
    meshes.append(trimesh.creation.box(bounds=[low, high]))
mesh = trimesh.util.concatenate(meshes)
width, height = 640, 360
views = [(np.array([*eye, 1.7]), np.array([np.cos(turn), np.sin(turn), 0.1])) for eye, turn in zip(a[:10], random.uniform(0, 6.28, 10))]
cameras = [View.perspective(eye, eye + ahead, fov_y=1.0, aspect=width / height) for eye, ahead in views]


def pixels(eye, ahead):
    ahead = ahead / np.linalg.norm(ahead)
    right = np.cross(ahead, (0, 0, 1))
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    x, y = np.meshgrid((np.arange(width) + 0.5) / width * 2 - 1, 1 - (np.arange(height) + 0.5) / height * 2)
    return (ahead + np.tan(0.5) * (x[..., None] * width / height * right + y[..., None] * up)).reshape(-1, 3)


def traced(eye, ahead):
    rays = pixels(eye, ahead)
    faces = mesh.ray.intersects_first(np.broadcast_to(eye, rays.shape), rays)
    return np.unique(faces[faces >= 0] // 12)


ours, reported = least(lambda: [scene.cull(camera) for camera in cameras])
theirs, hit = least(lambda: [traced(*view) for view in views])
lost = sum(len(np.setdiff1d(h, r)) for h, r in zip(hit, reported))
counts = f"{sum(map(len, reported))} reported, {sum(map(len, hit))} hit; {lost} hit and not reported"
kind = type(mesh.ray).__module__.split(".")[-1]
row(f"what 10 cameras see of 401 boxes: `cull`; a ray a pixel, 640x360, by trimesh.{kind}", ours, theirs, counts)
ours, images = least(lambda: [np.unique(image[image >= 0]) for image in (scene.item_buffer(c, size=(width, height)) for c in cameras)])
differ = sum(len(np.setxor1d(h, i)) for h, i in zip(hit, images))
row("the same; `item_buffer` in place of `cull`", ours, theirs, f"{differ} of {sum(map(len, hit))} differ")
