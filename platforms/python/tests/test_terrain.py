"""Viewsheds, against brute force over all edges of the surface in fractions."""

from fractions import Fraction

import numpy as np
import pytest
import visibility


def is_hidden(heights, eye, target):
    """Whether the segment passes below an edge of the surface, in exact arithmetic. Points: row, column, height."""
    rows, columns = heights.shape

    def side(p, q, r):
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    for row in range(rows):
        for column in range(columns):
            a = (row, column, int(heights[row, column]))
            for down, right in ((0, 1), (1, 0), (1, 1)):
                if row + down >= rows or column + right >= columns:
                    continue
                b = (row + down, column + right, int(heights[row + down, column + right]))
                of_a, of_b = side(eye, target, a), side(eye, target, b)
                of_eye, of_target = side(a, b, eye), side(a, b, target)
                if of_a == of_b or of_eye == of_target:
                    continue
                on_edge, on_sight = Fraction(of_a, of_a - of_b), Fraction(of_eye, of_eye - of_target)
                if 0 <= on_edge <= 1 and 0 < on_sight < 1:
                    if eye[2] + (target[2] - eye[2]) * on_sight < a[2] + (b[2] - a[2]) * on_edge:
                        return True
    return False


@pytest.mark.parametrize("seed", range(4))
def test_every_sample_agrees_with_fractions(seed):
    random = np.random.default_rng(seed)
    heights = random.integers(0, 6, (7, 9)).astype(np.float32)
    row, column = random.integers(0, 7), random.integers(0, 9)
    visible = visibility.viewshed(heights, (row, column), observer_height=1.0, target_height=1.0)
    hidden = visibility.hidden_heights(heights, (row, column), observer_height=1.0)
    eye = (int(row), int(column), int(heights[row, column]) + 1)
    for (r, c), seen in np.ndenumerate(visible):
        target = (r, c, int(heights[r, c]) + 1)
        assert seen == (not is_hidden(heights, eye, target)), (seed, r, c)
        assert seen == (hidden[r, c] <= 1.0 + 1e-9), (seed, r, c)
    assert 0 < visible.sum() < visible.size


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int16])
def test_types_and_layouts_give_one_answer(dtype):
    heights = np.random.default_rng(5).integers(0, 50, (40, 60)).astype(dtype)
    whole = visibility.viewshed(heights, (20, 30), cell_size=(3.0, 2.0))
    assert whole.shape == (40, 60) and whole.dtype == np.bool_
    assert (visibility.viewshed(np.asfortranarray(heights), (20, 30), cell_size=(3.0, 2.0)) == whole).all()
    stretched = np.repeat(heights, 2, axis=1)[:, ::2]
    assert not stretched.flags.c_contiguous
    assert (visibility.viewshed(stretched, (20, 30), cell_size=(3.0, 2.0)) == whole).all()
    turned = visibility.viewshed(np.ascontiguousarray(heights[::-1, ::-1]), (19, 29), cell_size=(3.0, 2.0))
    assert (turned[::-1, ::-1] == whole).all()


def test_counts_are_sums_on_any_number_of_threads():
    random = np.random.default_rng(6)
    heights = random.uniform(0, 9, (50, 40))
    observers = random.uniform(0, 39, (7, 2))
    alone = sum(visibility.viewshed(heights, observer, max_distance=30.0).astype(np.uint32) for observer in observers)
    for threads in (1, 3, 50, None):
        counts = visibility.viewshed_count(heights, observers, max_distance=30.0, threads=threads)
        assert counts.dtype == np.uint32 and (counts == alone).all(), threads
    none = visibility.viewshed_count(heights, np.empty((0, 2)))
    assert not none.any()


def test_holes_and_distance():
    heights = np.zeros((5, 9))
    heights[2, 4] = np.nan
    visible = visibility.viewshed(heights, (2, 2), max_distance=3.0)
    assert not visible[2, 4] and visible[2, 5] and not visible[2, 6]
    assert np.isnan(visibility.hidden_heights(heights, (2, 2), max_distance=3.0)[2, 6])


def test_a_million_samples():
    y, x = np.mgrid[0:1000, 0:1000] / 100.0
    heights = (100 * np.sin(x) * np.cos(y)).astype(np.float32)
    visible = visibility.viewshed(heights, (500.5, 499.25), cell_size=30.0)
    assert 0.02 < visible.mean() < 0.6


def test_fields_of_records_and_unaligned_bytes():
    heights = np.random.default_rng(6).integers(0, 50, (30, 40)).astype(np.float32)
    record = np.zeros(heights.shape, dtype=[("height", "f4"), ("class", "u1")])
    record["height"] = heights
    shifted = np.frombuffer(b"\0" + heights.tobytes(), np.float32, offset=1).reshape(heights.shape)
    whole = visibility.viewshed(heights, (12, 30))
    assert 0 < whole.sum() < whole.size
    for given in [record["height"], shifted]:
        assert (visibility.viewshed(given, (12, 30)) == whole).all()
        assert (visibility.viewshed_count(given, [(12, 30)]) == whole).all()


def test_masked_heights_are_refused():
    heights = np.zeros((9, 9), np.float32)
    heights[4, 3] = 32767
    masked = np.ma.masked_equal(heights, 32767)
    with pytest.raises(ValueError, match="masked.*nan"):
        visibility.viewshed(masked, (4, 0))
    assert visibility.viewshed(masked.filled(np.nan), (4, 0))[4].tolist() == [True] * 3 + [False] + [True] * 5
