"""A baked flat: from which viewcells a lamp may be seen, for lamps all over the flat, as an animated picture."""

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw  # comes with matplotlib
from visibility import BakedSet, Scene

# Walls of rooms around a corridor: from x, y to x, y. Metres.
WALLS = [
    (0, 0, 14, 0), (14, 0, 14, 10), (0, 10, 14, 10), (0, 0, 0, 10),
    (0, 4, 1.5, 4), (2.5, 4, 6.5, 4), (7.5, 4, 11, 4), (12, 4, 14, 4),
    (0, 6, 3, 6), (4, 6, 8.5, 6), (9.5, 6, 12, 6), (13, 6, 14, 6),
    (5, 0, 5, 4), (10, 0, 10, 4), (6, 6, 6, 10), (11, 6, 11, 10), (2, 7.5, 2, 9),
]  # fmt: skip
HEIGHT, HALF, CELL, SCALE = 2.6, 0.06, 0.5, 40

scene = Scene()
walls = [[(a - HALF, b - HALF, 0), (c + HALF, d + HALF, HEIGHT)] for a, b, c, d in WALLS]
scene.add_boxes([*walls, [(-1, -1, -0.2), (15, 11, 0)], [(-1, -1, HEIGHT), (15, 11, HEIGHT + 0.2)]])
# Lamps hide nothing. They hang along a way through all rooms.
stops = np.array([(2, 1), (2, 5), (3.5, 5), (3.5, 8), (3.5, 5), (7, 5), (7, 2), (7, 5), (9, 5), (9, 8), (9, 5), (11.5, 5),
                  (11.5, 2), (11.5, 5), (12.5, 5), (12.5, 8)])  # fmt: skip
passed = np.concatenate([[0], np.hypot(*np.diff(stops, axis=0).T).cumsum()])
way = np.column_stack([np.interp(np.linspace(0, passed[-1], 36), passed, side) for side in stops.T])
lamps = scene.add_boxes([[(x - 0.1, y - 0.1, 1.5), (x + 0.1, y + 0.1, 1.7)] for x, y in way], solid=False)

cells = Scene.grid_cells([(0, 0, 1.5), (14, 10, 1.75)], (CELL, CELL, 0.25))
# As a level would be: baked once, kept as bytes, and read by the game.
data = scene.bake(cells).to_bytes()
baked = BakedSet.from_bytes(data)
seen = np.array([np.isin(lamps, baked.row(cell)) for cell in range(len(baked))])
print(f"{len(baked)} viewcells in {len(data)} bytes; a lamp is seen from {100 * seen.mean():.0f} % of them in the mean")
assert (seen.any(axis=0) & ~seen.all(axis=0)).all(), "each lamp is seen from some viewcells and not from others"

PALETTE = np.array([(250, 250, 247), (255, 209, 102), (45, 49, 66), (214, 40, 57)], np.uint8)
frames = []
for (x, y), column in zip(way, seen.T):
    frame = Image.new("P", (14 * SCALE + 8, 10 * SCALE + 8), 0)
    frame.putpalette(PALETTE.tobytes())
    draw = ImageDraw.Draw(frame)

    def place(x, y):
        return 4 + x * SCALE, 4 + (10 - y) * SCALE

    for (low, high), is_seen in zip(cells, column):
        if is_seen:
            left, bottom = place(*low[:2])
            right, top = place(*high[:2])
            draw.rectangle((left, top, right - 1, bottom - 1), fill=1)
    for a, b, c, d in WALLS:
        draw.line([place(a, b), place(c, d)], fill=2, width=5)
    left, top = place(x, y)
    draw.ellipse((left - 6, top - 6, left + 6, top + 6), fill=3)
    frames.append(frame)

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)
path = folder / "baked_cells.png"
frames[0].save(path, save_all=True, append_images=frames[1:], duration=300, loop=0, optimize=True)
print(f"wrote {path}, {path.stat().st_size // 1000} kB")
