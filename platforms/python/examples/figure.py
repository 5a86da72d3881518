"""What the examples share: where pictures go, and how walls and polygons are drawn."""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.collections import LineCollection, PolyCollection  # noqa: E402

#: Colours: what is seen, what is seen twice or matters most, walls, eyes.
SEEN, MORE, WALL, EYE = "#ffd166", "#ef8354", "#2d3142", "#d62839"


def plan_axes(walls, title, *, size=(7, 6)):
    """Makes axes with walls, (n, 2, 2), drawn to scale."""
    figure, axes = plt.subplots(figsize=size, layout="constrained")
    axes.add_collection(LineCollection(walls, colors=WALL, linewidths=1.8, zorder=3))
    axes.set_title(title)
    axes.set_aspect("equal")
    axes.set_xlabel("m")
    axes.autoscale_view()
    return figure, axes


def fill(axes, polygons, color, alpha=0.6):
    """Fills polygons, each (k, 2)."""
    axes.add_collection(PolyCollection(polygons, facecolors=color, edgecolors="none", alpha=alpha, zorder=1))


def eyes(axes, points, label=None):
    """Marks eyes, (n, 2)."""
    axes.plot(*points.T, "o", color=EYE, markersize=7, zorder=5, label=label)


def save(figure, name):
    """Writes a picture into the folder named on the command line, or here."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    figure.savefig(path, dpi=100)
    plt.close(figure)
    print(f"wrote {path}")
