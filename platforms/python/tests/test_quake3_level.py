"""The reader of Quake 3 levels among the examples: what it finds, and that broken files are refused in words."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

spec = importlib.util.spec_from_file_location("quake3_level", Path(__file__).parent.parent / "examples" / "quake3_level.py")
quake3_level = importlib.util.module_from_spec(spec)
spec.loader.exec_module(quake3_level)


def test_polygons_patches_and_starts():
    meshes, starts = quake3_level.read(quake3_level.made_up())
    # Ten boxes of six sides, an arch, water, and a door of six sides, which is a model of its own.
    assert len(meshes) == 10 * 6 + 2 + 6
    assert [hides for _, _, hides in meshes] == [True] * 60 + [False] * 8
    assert starts == pytest.approx(np.array([[96, 256, 56]]) * 0.0254)
    corners = np.concatenate([positions for positions, _, _ in meshes])
    assert corners.max(axis=0) == pytest.approx(np.array([1024, 512, 192]) * 0.0254, rel=1e-6)
    positions, triangles, _ = meshes[60]
    assert (positions.shape, triangles.shape) == ((25, 3), (32, 3))
    # The middle of a quadratic curve is a quarter, a half and a quarter of its control points.
    height = positions[:, 2].max() / 0.0254
    assert height == pytest.approx(0.5 * 190)
    area = np.linalg.norm(np.cross(*(positions[triangles[:, k]] - positions[triangles[:, 0]] for k in (1, 2))), axis=1)
    assert (area > 1e-3).all()


def test_larger_patches_are_joined():
    x, y = np.meshgrid(np.arange(5.0), np.arange(3.0))
    positions, triangles = quake3_level.patch(np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]), 5, 3)
    a, b, c = (positions[triangles[:, k], :2] for k in range(3))
    areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert np.abs(areas).sum() == pytest.approx(8.0) and (len(set(np.sign(areas))) == 1)


def with_face(number, field, value):
    """Returns the level with another value in a face."""
    level = bytearray(quake3_level.made_up())
    start = int.from_bytes(level[8 + 8 * 13 : 12 + 8 * 13], "little")
    faces = np.frombuffer(level, quake3_level.FACE, number + 1, start)
    faces[field][number] = value
    return bytes(level)


def with_world(first, count):
    """Returns the level with another range of faces of its first model."""
    level = bytearray(quake3_level.made_up())
    start = int.from_bytes(level[8 + 8 * 7 : 12 + 8 * 7], "little")
    level[start + 24 : start + 32] = first.to_bytes(4, "little") + count.to_bytes(4, "little")
    return bytes(level)


def test_only_the_world_hides():
    hides = [hides for _, _, hides in quake3_level.read(with_world(6, 10))[0]]
    assert hides == [False] * 6 + [True] * 10 + [False] * 52
    without = bytearray(quake3_level.made_up())
    without[12 + 8 * 7 : 16 + 8 * 7] = bytes(4)
    assert not any(hides for _, _, hides in quake3_level.read(bytes(without))[0]), "a level without models"


@pytest.mark.parametrize("data, message", [
    (with_world(60, 9), "the world has unknown faces"),
    (with_world(2**32 - 1, 2), "the world has unknown faces"),
    (quake3_level.made_up().replace(b"IBSP\x2e", b"IBSP\x26"), "no level of Quake 3"),
    (quake3_level.made_up()[:-1], "faces: .* bytes from"),
    (with_face(3, "texture", 2), "face 3 has unknown parts"),
    (with_face(3, "vertex", 10**6), "face 3 has unknown parts"),
    (with_face(3, "indices", 4), "face 3 has unknown vertices"),
    (with_face(3, "vertices", 3), "face 3 has unknown vertices"),
    (with_face(3, "index", 10**6), "face 3 has unknown parts"),
    (with_face(3, "vertices", 10**6), "more vertices than there are"),
    (with_face(60, "size", (9, 1)), "face 60 is no patch of 9 x 1"),
])  # fmt: skip
def test_refused(data, message):
    with pytest.raises(ValueError, match=message):
        quake3_level.read(data)


def test_surfaces_that_are_not_drawn_are_left_out():
    level = quake3_level.made_up()
    at = level.index(b"textures/water") + 64
    assert len(quake3_level.read(level[:at] + b"\x80" + level[at + 1 :])[0]) == 67


def test_broken_files_raise_nothing_but_value_errors():
    level = quake3_level.made_up()
    random, refused = np.random.default_rng(1), 0
    broken = [level[:end] for end in range(0, len(level), 101)]
    for _ in range(400):
        data = np.frombuffer(level, np.uint8).copy()
        data[random.integers(len(data), size=40)] = random.integers(256, size=40)
        broken.append(data.tobytes())
    for data in broken:
        try:
            with np.errstate(all="ignore"):
                quake3_level.read(data)
        except ValueError:
            refused += 1
    assert refused > 100
