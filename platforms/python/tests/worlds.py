"""What several tests look at."""

import numpy as np

from visibility import View

AHEAD = View.perspective((0, 0, 0), (1, 0, 0))
WALL = [(5.0, -10.0, -10.0), (5.5, 10.0, 10.0)]
LAMP = [(8.0, -1.0, -1.0), (9.0, 1.0, 1.0)]


def city(blocks, seed=1):
    """Houses of a street grid, (n, 2, 3)."""
    random = np.random.default_rng(seed)
    place = np.stack(np.meshgrid(np.arange(blocks), np.arange(blocks)), axis=-1).reshape(-1, 2) * 30.0
    low = np.column_stack([place + 5.0, np.zeros(len(place))])
    high = np.column_stack([place + 25.0, random.uniform(5.0, 40.0, len(place))])
    return np.stack([low, high], axis=1)
