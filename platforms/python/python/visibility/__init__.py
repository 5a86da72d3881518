"""Who can see what: terrain, floor plans, scenes of objects, and regions.

Lengths are in metres and angles in radians. Arrays are numpy arrays; ``float64`` where nothing else is said. Arrays of
another shape or type are refused with a ``ValueError`` that names the argument; lists of numbers are taken as well.
Calls run without the interpreter's lock, so that threads run side by side.

- Terrain: :func:`viewshed`, :func:`viewshed_count`, :func:`hidden_heights`.
- Floor plans: :class:`Plan`, :class:`UnseenRegion`.
- Scenes: :class:`Scene`, :class:`View`, :class:`Cells`, :class:`BakedSet`.

Nothing that is visible is ever reported as hidden by mistake; each function says what "visible" means.
"""

from ._visibility import (
    BakedSet,
    Cells,
    UnseenRegion,
    View,
    hidden_heights,
    viewshed,
    viewshed_count,
)
from .plan import Plan
from .scene import Scene

__all__ = [
    "BakedSet",
    "Cells",
    "Plan",
    "Scene",
    "UnseenRegion",
    "View",
    "hidden_heights",
    "viewshed",
    "viewshed_count",
]
