"""Which rooms of a house see the garden, and how much of each: windows and doors as walls that let sight through."""

import figure
import numpy as np
from visibility import Plan

# Walls of the house; metres. The garden is in front of it, y < 0, with a hedge around and a shed in it.
ROOMS = {
    "living room": [(0, 0), (6, 0), (6, 5), (0, 5)],
    "kitchen": [(6, 0), (10, 0), (10, 4), (6, 4)],
    "hall": [(6, 4), (10, 4), (10, 9), (6, 9)],
    "study": [(0, 5), (3, 5), (3, 9), (0, 9)],
    "bath": [(3, 5), (6, 5), (6, 9), (3, 9)],
}
OPENINGS = [
    [(1, 0), (5, 0)],  # window of the living room
    [(7, 0), (8, 0)],  # window of the kitchen
    [(6, 1.5), (6, 2.5)],  # door from living room to kitchen
    [(8.5, 4), (9.5, 4)],  # door from kitchen to hall
    [(1, 5), (2, 5)],  # door from living room to study
    [(6, 7), (6, 8)],  # door from hall to bath
]
GARDEN = [(-2, -12), (12, -12), (12, -0.5), (-2, -0.5)]
SHED = [(7, -9), (11, -9), (11, -6), (7, -6)]


def cut(wall, openings):
    """Returns a wall that runs along an axis without its openings."""
    axis = 0 if wall[0][1] == wall[1][1] else 1
    fixed = wall[0][1 - axis]
    low, high = sorted(end[axis] for end in wall)
    gaps = sorted(
        sorted(end[axis] for end in gap) for gap in openings if all(end[1 - axis] == fixed for end in gap)
    )
    pieces, at = [], low
    for start, stop in gaps:
        if start >= low and stop <= high:
            pieces.append((at, start))
            at = stop
    pieces.append((at, high))
    point = (lambda value: (value, fixed)) if axis == 0 else (lambda value: (fixed, value))
    return [[point(start), point(stop)] for start, stop in pieces if start < stop]


walls = []
for outline in ROOMS.values():
    for wall in zip(outline, outline[1:] + outline[:1]):
        walls += cut(wall, OPENINGS)
hedge = [[(-2, 0), (-2, -12)], [(-2, -12), (12, -12)], [(12, -12), (12, 0)]]
shed = list(zip(SHED, SHED[1:] + SHED[:1]))
plan = Plan(np.array(walls + hedge + shed, dtype=np.float64))

# What the garden can see of the house is what sees the garden. First whole rooms, exactly: a room sees something of
# the garden if the region of one sees the other. Then shares of each room, by points on a grid of 20 cm.
x, y = np.meshgrid(np.arange(-1.9, 12, 0.5), np.arange(-11.9, -0.4, 0.5))
spots = np.column_stack([x.ravel(), y.ravel()])
in_shed = (spots > SHED[0]).all(axis=1) & (spots < SHED[2]).all(axis=1)
spots = spots[~in_shed]
picture, axes = figure.plan_axes(plan.walls, "Garden seen from each place of the house", size=(7, 8))
for name, outline in ROOMS.items():
    low, high = np.min(outline, axis=0), np.max(outline, axis=0)
    x, y = np.meshgrid(np.arange(low[0] + 0.1, high[0], 0.2), np.arange(low[1] + 0.1, high[1], 0.2))
    places = np.column_stack([x.ravel(), y.ravel()])
    seen = plan.sees(np.repeat(places, len(spots), axis=0), np.tile(spots, (len(places), 1)))
    seen = seen.reshape(len(places), len(spots))
    share = seen.mean(axis=1)
    print(f"{name:12} {100 * (share > 0).mean():5.1f} % of it sees some of the garden, at most {100 * share.max():4.1f} %")
    image = share.reshape(x.shape)
    extent = (low[0], high[0], low[1], high[1])
    drawn = axes.imshow(image, extent=extent, origin="lower", cmap="YlGn", vmin=0, vmax=1, zorder=0)
    axes.text(*(low + high) / 2, name, ha="center", va="center", zorder=6)
    if name == "living room":
        assert share.max() > 0.5
    if name == "bath":
        assert share.max() == 0
figure.fill(axes, [plan.visibility_polygon((3.0, 3.0))], figure.SEEN, alpha=0.35)
figure.eyes(axes, np.array([[3.0, 3.0]]))
picture.colorbar(drawn, ax=axes, label="share of the garden seen", shrink=0.7)
axes.set_xlim(-2.5, 12.5)
axes.set_ylim(-12.5, 9.5)
figure.save(picture, "garden_rooms.png")
