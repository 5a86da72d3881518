"""A walk over hills: what is seen from each step of it, as an animated picture."""

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw  # comes with matplotlib
from visibility import viewshed

ROWS, COLUMNS, CELL = 220, 360, 25.0  # samples, and metres between them
STEPS = 30

# Hills: sums of smooth bumps, and a valley along which the walk leads.
random = np.random.default_rng(7)
y, x = np.mgrid[0:ROWS, 0:COLUMNS]
heights = 40 * (np.cos(x / 23) + np.cos(y / 17 + 1))
for _ in range(60):
    row, column, size = random.uniform(0, ROWS), random.uniform(0, COLUMNS), random.uniform(8, 30)
    heights += random.uniform(10, 70) * np.exp(-((x - column) ** 2 + (y - row) ** 2) / (2 * size**2))
way = np.column_stack([ROWS * (0.5 + 0.3 * np.sin(np.linspace(0, 4, STEPS))), np.linspace(20, COLUMNS - 20, STEPS)])

# Colours by number: eight levels of land that is not seen, and the same eight where it is seen; then the way, the eye.
levels = np.linspace(0.35, 0.95, 8)[:, None]
palette = np.concatenate([levels * (205, 208, 200), levels * (120, 215, 95), [(120, 90, 60), (214, 40, 57)]])
palette = palette.round().astype(np.uint8)
bands = np.digitize(heights, np.quantile(heights, np.linspace(0, 1, 9)[1:-1]))

frames, shares = [], []
for step in way:
    seen = viewshed(heights, step, cell_size=CELL, observer_height=1.8)
    shares.append(seen.mean())
    frame = Image.fromarray((bands + 8 * seen).astype(np.uint8)).resize((2 * COLUMNS, 2 * ROWS), Image.Resampling.NEAREST)
    frame.putpalette(palette.tobytes())
    draw = ImageDraw.Draw(frame)
    draw.line([(2 * column + 1, 2 * row + 1) for row, column in way], fill=16, width=2)
    row, column = 2 * step + 1
    draw.ellipse((column - 6, row - 6, column + 6, row + 6), fill=17)
    frames.append(frame)

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
folder.mkdir(parents=True, exist_ok=True)
path = folder / "terrain_walk.png"
frames[0].save(path, save_all=True, append_images=frames[1:], duration=250, loop=0, optimize=True)
print(f"{STEPS} steps, from which {min(shares):.0%} to {max(shares):.0%} of the land are seen")
assert 0 < min(shares) < max(shares) < 1
print(f"wrote {path}, {path.stat().st_size // 1000} kB")
