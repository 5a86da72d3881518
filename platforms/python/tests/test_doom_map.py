"""The reader of Doom maps among the examples: what it finds, and that broken files are refused in words."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from visibility import Plan

spec = importlib.util.spec_from_file_location("doom_map", Path(__file__).parent.parent / "examples" / "doom_map.py")
doom_map = importlib.util.module_from_spec(spec)
spec.loader.exec_module(doom_map)


def longer(wad, name):
    """Returns a .wad in whose directory a lump has a million bytes."""
    at = wad.index(name)
    return wad[: at - 4] + (10**6).to_bytes(4, "little") + wad[at:]


def test_walls_doors_and_starts():
    walls, doors, starts = doom_map.read(doom_map.made_up(), "e1m1")
    assert (walls.shape, doors.shape, starts.tolist()) == ((20, 2, 2), (2, 2, 2), [[96, 96], [960, 256]])
    assert walls[0].tolist() == [[0, 0], [512, 0]]
    assert doors.tolist() == [[[568, 192], [568, 320]], [[584, 192], [584, 320]]]
    # Through the corridor, past the pillar, the line of sight is open but for the door.
    assert Plan(walls).sees([(480, 256)], [(960, 256)]).tolist() == [True]
    assert Plan(np.concatenate([walls, doors])).sees([(480, 256)], [(960, 256)]).tolist() == [False]


@pytest.mark.parametrize("change, message", [
    (lambda wad: b"ZWAD" + wad[4:], "neither IWAD nor PWAD"),
    (lambda wad: wad[:-1], "the directory of 6 lumps ends beyond the file"),
    (lambda wad: longer(wad, b"VERTEXES"), "lump VERTEXES ends beyond the file"),
    (lambda wad: wad.replace(b"SECTORS", b"SECTORZ"), "SECTORS is missing"),
    (lambda wad: wad.replace(b"THINGS\0\0", b"TEXTMAP\0"), "Hexen and in UDMF"),
])  # fmt: skip
def test_refused(change, message):
    with pytest.raises(ValueError, match=message):
        doom_map.read(change(doom_map.made_up()))


def test_unknown_map():
    with pytest.raises(ValueError, match="no map MAP07; the maps are E1M1"):
        doom_map.read(doom_map.made_up(), "MAP07")


def test_broken_files_raise_nothing_but_value_errors():
    wad = doom_map.made_up()
    random, refused = np.random.default_rng(1), 0
    broken = [wad[:end] for end in range(0, len(wad), 3)]
    for _ in range(2000):
        data = np.frombuffer(wad, np.uint8).copy()
        data[random.integers(len(data), size=3)] = random.integers(256, size=3)
        broken.append(data.tobytes())
    for data in broken:
        try:
            walls, _, _ = doom_map.read(data)
            assert walls.ndim == 3
        except ValueError:
            refused += 1
    assert refused > 500
