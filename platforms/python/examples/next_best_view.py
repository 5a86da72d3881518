"""A robot explores a flat: each time it goes where it sees most that is new for the way it walks."""

import figure
import numpy as np
from visibility import Plan

# Rooms around a corridor. Metres.
WALLS = [
    [(0, 0), (14, 0)], [(14, 0), (14, 10)], [(14, 10), (0, 10)], [(0, 10), (0, 0)],
    # The corridor, from y = 4 to 6, and its doors.
    [(0, 4), (1.5, 4)], [(2.5, 4), (6.5, 4)], [(7.5, 4), (11, 4)], [(12, 4), (14, 4)],
    [(0, 6), (3, 6)], [(4, 6), (8.5, 6)], [(9.5, 6), (12, 6)], [(13, 6), (14, 6)],
    # Between rooms, and a cupboard.
    [(5, 0), (5, 4)], [(10, 0), (10, 4)], [(6, 6), (6, 10)], [(11, 6), (11, 10)], [(2, 7.5), (2, 9)],
]  # fmt: skip

plan = Plan(WALLS)
robot = np.array([0.5, 5.0])
unseen = plan.unseen([robot])
total = unseen.area
x, y = np.meshgrid(np.arange(0.25, 14, 0.5), np.arange(0.25, 10, 0.5))
places = np.column_stack([x.ravel(), y.ravel()])

unseen.look(robot)
steps, walked = [robot], [robot[None]]
while unseen.area > 0.005 * total and len(steps) < 30:
    gains = unseen.gains(places)
    # The way to the few best places is computed; a metre of it costs as much as a square metre unseen is worth.
    best = None
    for place in places[np.argsort(gains)[-12:]]:
        path = plan.shortest_path(robot, place)
        if path is not None:
            length = np.hypot(*np.diff(path, axis=0).T).sum()
            worth = gains[np.flatnonzero((places == place).all(axis=1))[0]] - length
            if best is None or worth > best[0]:
                best = (worth, place, path)
    assert best is not None, "some place can be reached"
    _, robot, path = best
    unseen.look(robot)
    steps.append(robot)
    walked.append(path)
length = sum(np.hypot(*np.diff(path, axis=0).T).sum() for path in walked)
share = 1 - unseen.area / total
print(f"{len(steps)} looks and {length:.1f} m on the way: {100 * share:.1f} % of {total:.0f} square metres seen")
assert share > 0.99

picture, axes = figure.plan_axes(plan.walls, f"{len(steps)} looks and {length:.0f} m: {100 * share:.1f} % seen", size=(8, 6))
figure.fill(axes, [plan.visibility_polygon(step) for step in steps], figure.SEEN, alpha=0.25)
figure.fill(axes, unseen.polygons(), "black", alpha=0.7)
axes.plot(*np.concatenate(walked).T, "--", color=figure.MORE, zorder=4)
figure.eyes(axes, np.array(steps))
for number, step in enumerate(steps):
    axes.annotate(str(number + 1), step, textcoords="offset points", xytext=(6, 6), zorder=6)
figure.save(picture, "next_best_view.png")
