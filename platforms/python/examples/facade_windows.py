"""How much of a façade's windows look at a tower: for each window, the share of the tower that is seen from it."""

import figure
import numpy as np
from matplotlib.patches import Rectangle
from visibility import Scene

# A façade along y = 0 that looks towards +y, with 12 windows on each of 7 floors. Metres.
FLOORS, COLUMNS = 7, 12
WINDOWS = np.array([
    [(4.0 * column + 1.2, 0.02, 3.2 * floor + 1.0), (4.0 * column + 2.8, 0.12, 3.2 * floor + 2.4)]
    for floor in range(FLOORS) for column in range(COLUMNS)
])  # fmt: skip
# Houses across the street and a yard, and a tower behind them, in storeys of which each is an object.
HOUSES = np.array([
    [(-12, 16, 0), (7, 28, 13)], [(10, 18, 0), (21, 30, 9)], [(24, 15, 0), (33, 29, 19)], [(37, 17, 0), (58, 29, 15)],
    [(2, 40, 0), (24, 52, 17)], [(30, 41, 0), (47, 55, 21)],
], dtype=float)  # fmt: skip
TOWER, STOREY, HEIGHT = np.array([(22.0, 70.0), (32.0, 80.0)]), 3.0, 60.0

scene = Scene(origin=(24, 40, 0))
scene.add_boxes([*HOUSES, [(-30, -0.5, -0.5), (80, 100, 0)], [(-5, -10, 0), (53, 0, 3.2 * FLOORS)]])
bottoms = np.arange(0.0, HEIGHT, STOREY)
storeys = scene.add_boxes([[(*TOWER[0], z), (*TOWER[1], z + STOREY)] for z in bottoms])

shares, doubts = [], 0
for window in WINDOWS:
    seen, _, undecided, _ = scene.prove_from_region(window)
    shares.append(np.isin(storeys, seen).mean())
    doubts += np.isin(storeys, undecided).sum()
shares = np.array(shares)
looks = (shares > 0).mean()
print(f"{100 * looks:.0f} % of the windows look at the tower; the mean one at {100 * shares.mean():.0f} % of its storeys,")
print(f"the best at {100 * shares.max():.0f} %; {doubts} of {len(shares) * len(storeys)} answers are open")
# Higher windows see more: no storey that is seen from a window is hidden from the one above it.
by_floor = shares.reshape(FLOORS, COLUMNS)
assert (np.diff(by_floor, axis=0) >= 0).all() and 0 < looks <= 1 and doubts == 0

picture, (wall, plan) = figure.plt.subplots(1, 2, figsize=(13, 5), layout="constrained", width_ratios=(1.6, 1))
colors = figure.plt.get_cmap("YlOrRd")
wall.add_patch(Rectangle((-1, 0), 4 * COLUMNS + 2, 3.2 * FLOORS + 0.5, color="#d9dce3", zorder=0))
for (low, high), share in zip(WINDOWS, shares):
    wall.add_patch(Rectangle(low[[0, 2]], *(high - low)[[0, 2]], facecolor=colors(share), edgecolor=figure.WALL, lw=0.6))
    wall.text(*((low + high) / 2)[[0, 2]], f"{100 * share:.0f}", ha="center", va="center", fontsize=6,
              color="white" if share > 0.7 else "black")
wall.set_title(f"Storeys of the tower seen from each window, in %: {100 * looks:.0f} % of the windows see it")
plan.add_patch(Rectangle((-5, -10), 58, 10, color="#d9dce3"))
for low, high in HOUSES:
    plan.add_patch(Rectangle(low[:2], *(high - low)[:2], color="#8d99ae"))
    plan.text(*((low + high) / 2)[:2], f"{high[2]:.0f} m", ha="center", va="center", fontsize=8)
plan.add_patch(Rectangle(TOWER[0], *(TOWER[1] - TOWER[0]), color=figure.MORE))
plan.text(*TOWER.mean(axis=0), f"{HEIGHT:.0f} m", ha="center", va="center", fontsize=8)
plan.set_title("From above: façade below, tower above")
for axes in (wall, plan):
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_xlabel("m")
figure.save(picture, "facade_windows.png")
