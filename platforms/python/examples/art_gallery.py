"""An art gallery: few guards that together see all of it, and a proof of how few it could be."""

import figure
import numpy as np
from visibility import Plan

# A hall with wings, walls that stick into it, and pillars. Metres.
OUTLINE = [(0, 0), (8, 0), (8, 3), (14, 3), (14, 0), (22, 0), (22, 7), (18, 7), (18, 10), (22, 10), (22, 16), (13, 16)]
OUTLINE += [(13, 13), (9, 13), (9, 16), (0, 16), (0, 11), (4, 11), (4, 6), (0, 6)]
PILLARS = [[(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)] for x, y in ((7, 6), (13, 6), (7, 9), (13, 9))]
SCREENS = [[(4, 2), (4, 5)], [(18, 1.5), (18, 5)], [(17, 12), (20, 12)]]

outlines = Plan.from_polygons([OUTLINE, *PILLARS])
plan = Plan(np.concatenate([outlines.walls, SCREENS]))
inside = [(10.0, 5.0)]
guards, witnesses = plan.guards(inside)

unseen = plan.unseen(inside)
all_of_it = unseen.area
for guard in guards:
    unseen.look(guard)
print(f"{len(guards)} guards see {100 * (1 - unseen.area / all_of_it):.3f} % of {all_of_it:.0f} square metres;")
print(f"at least {len(witnesses)} are needed")
assert unseen.area < 1e-6 * all_of_it and len(witnesses) <= len(guards)

picture, axes = figure.plan_axes(plan.walls, f"{len(guards)} guards see all; at least {len(witnesses)} are needed")
for number, guard in enumerate(guards):
    figure.fill(axes, [plan.visibility_polygon(guard)], f"C{number}", alpha=0.25)
figure.eyes(axes, guards, "guards")
axes.plot(*witnesses.T, "k^", markersize=6, zorder=5, label="no point sees two of these")
axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=2)
figure.save(picture, "art_gallery.png")
