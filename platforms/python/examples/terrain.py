"""A viewshed of hills, how high a mast must be to be seen, and how many of some towers see each place."""

import figure
import numpy as np
from visibility import hidden_heights, viewshed, viewshed_count


def hills(size, seed):
    """Returns heights of hills in metres: noise whose height falls with its frequency."""
    random = np.random.default_rng(seed)
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
    frequency[0, 0] = np.inf
    heights = np.fft.ifft2(np.fft.fft2(random.normal(size=(size, size))) * frequency**-2.1).real
    return (300 * (heights - heights.min()) / np.ptp(heights)).astype(np.float32)


CELL = 25.0  # metres
heights = hills(500, 3)
observer = np.unravel_index(heights[150:350, 150:350].argmax(), (200, 200)) + np.array([150, 150])
visible = viewshed(heights, observer, cell_size=CELL, observer_height=10.0)
hidden = hidden_heights(heights, observer, cell_size=CELL, observer_height=10.0)
towers = np.array([(y, x) for y in range(50, 500, 100) for x in range(50, 500, 100)], dtype=np.float64)
count = viewshed_count(heights, towers, cell_size=CELL, observer_height=30.0, target_height=1.5, max_distance=5e3)
print(f"{100 * visible.mean():.1f} % of the land is seen; {100 * (hidden <= 30).mean():.1f} % with masts of 30 m;")
print(f"{len(towers)} towers see {100 * (count > 0).mean():.1f} % of the land, {100 * (count > 1).mean():.1f} % twice")
assert (visible == (hidden <= 0)).all() and visible[tuple(observer)]

slope_y, slope_x = np.gradient(heights, CELL)
shade = 0.5 + 0.5 * np.clip((slope_x + slope_y) * 2, -1, 1)
extent = (0, 500 * CELL / 1000, 500 * CELL / 1000, 0)
picture, axes = figure.plt.subplots(1, 3, figsize=(16, 5.2), layout="constrained")
for frame in axes:
    frame.imshow(shade, cmap="gray", extent=extent)
    frame.set_xlabel("km")
axes[0].imshow(np.ma.masked_equal(visible, False), cmap="autumn_r", alpha=0.55, extent=extent)
axes[0].set_title(f"Seen from a summit: {100 * visible.mean():.0f} %")
drawn = axes[1].imshow(np.minimum(hidden, 150), cmap="viridis_r", alpha=0.7, extent=extent)
picture.colorbar(drawn, ax=axes[1], label="m", shrink=0.8)
axes[1].set_title("Height that a mast needs to be seen")
drawn = axes[2].imshow(count, cmap="magma", alpha=0.7, extent=extent)
picture.colorbar(drawn, ax=axes[2], label="towers", shrink=0.8)
axes[2].plot(*(towers[:, ::-1].T * CELL / 1000), "w+", markersize=5)
axes[2].set_title("Towers that see a person within 5 km")
for frame in axes[:2]:
    frame.plot(*(observer[::-1] * CELL / 1000), "o", color=figure.EYE)
figure.save(picture, "terrain.png")
