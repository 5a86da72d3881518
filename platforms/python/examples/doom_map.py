"""The plan of a map in a Doom .wad, and what the player sees at its start.

    python doom_map.py PICTURES [FILE.wad [MAP]]

Without a file, it draws a small map of its own. Numpy reads the lists of a map as they are, so no package is needed.
Format: "The Unofficial Doom Specs". Maps of Doom, Doom 2 and Heretic are read; those of Hexen and UDMF are refused.
"""

import sys

import numpy as np

LINE = np.dtype([("ends", "<u2", 2), ("flags", "<u2"), ("special", "<u2"), ("tag", "<u2"), ("sides", "<u2", 2)])
SIDE = np.dtype([("offset", "<i2", 2), ("textures", "S8", 3), ("sector", "<u2")])
SECTOR = np.dtype([("floor", "<i2"), ("ceiling", "<i2"), ("pictures", "S8", 2), ("other", "<i2", 3)])
THING = np.dtype([("place", "<i2", 2), ("angle", "<i2"), ("kind", "<i2"), ("flags", "<i2")])
VERTEX = np.dtype(("<i2", 2))
#: Lists of a map, in the order in which they follow its name; the first four of these are what is needed.
LISTS = {"THINGS": THING, "LINEDEFS": LINE, "SIDEDEFS": SIDE, "VERTEXES": VERTEX, "SECTORS": SECTOR}
NO_SIDE = 0xFFFF


def lumps(data):
    """Returns the names and contents of all lumps of a .wad, in order."""
    if data[:4] not in (b"IWAD", b"PWAD") or len(data) < 12:
        raise ValueError("no .wad: it begins with neither IWAD nor PWAD")
    count, start = (int.from_bytes(data[k : k + 4], "little") for k in (4, 8))
    if start + 16 * count > len(data):
        raise ValueError(f"the directory of {count} lumps ends beyond the file")
    entries = np.frombuffer(data, [("from", "<u4"), ("size", "<u4"), ("name", "S8")], count, start)
    found = []
    for entry in entries:
        begin, end = int(entry["from"]), int(entry["from"]) + int(entry["size"])
        name = entry["name"].decode("ascii", "replace").upper()
        if end > len(data):
            raise ValueError(f"lump {name} ends beyond the file")
        found.append((name, data[begin:end]))
    return found


def read(data, name=None):
    """Returns walls (n, 2, 2), doors (k, 2, 2) and starts (m, 2) of a map, the first one if no name is given.

    Walls are lines with one side. Doors are lines with two, between which there is no gap at the beginning.
    """
    every = lumps(data)
    names = [lump for lump, _ in every]
    maps = [at for at, lump in enumerate(names[:-1]) if names[at + 1] in ("THINGS", "TEXTMAP")]
    at = next((at for at in maps if name is None or names[at] == name.upper()), None)
    if at is None:
        raise ValueError(f"no map {name or 'at all'}; the maps are {', '.join(names[at] for at in maps) or 'none'}")
    parts = dict(reversed(every[at + 1 : at + 12]))
    if "BEHAVIOR" in parts or names[at + 1] == "TEXTMAP":
        raise ValueError(f"{names[at]}: maps of Hexen and in UDMF are not read")
    lists = {}
    for part, kind in LISTS.items():
        if part not in parts or len(parts[part]) % kind.itemsize:
            raise ValueError(f"{names[at]}: {part} is missing, or no whole number of items of {kind.itemsize} bytes")
        lists[part] = np.frombuffer(parts[part], kind)
    lines, sides, sectors = lists["LINEDEFS"], lists["SIDEDEFS"], lists["SECTORS"]
    vertices = lists["VERTEXES"].astype(float)
    has_two = (lines["sides"] != NO_SIDE).all(axis=1)
    beside = lines["sides"][has_two]
    for what, numbers, known in (
        ("vertex", lines["ends"], vertices), ("side", beside, sides), ("sector", sides["sector"], sectors)
    ):  # fmt: skip
        if numbers.size and numbers.max() >= len(known):
            raise ValueError(f"{names[at]}: unknown {what} {numbers.max()} of {len(known)}")
    segments = vertices.reshape(-1, 2)[lines["ends"]]
    around = sides["sector"][beside]
    is_shut = sectors["floor"][around].max(axis=1) >= sectors["ceiling"][around].min(axis=1)
    things = lists["THINGS"]
    starts = things["place"][np.isin(things["kind"], (1, 2, 3, 4, 11))].astype(float)
    return segments[~has_two], segments[has_two][is_shut], starts


def made_up():
    """Makes a .wad with a map of two rooms and a corridor with a door, for when there is none."""
    corners = [(0, 0), (512, 0), (512, 192), (640, 192), (640, 0), (1088, 0), (1088, 512), (640, 512), (640, 320),
               (512, 320), (512, 512), (0, 512), (192, 192), (320, 192), (320, 320), (192, 320),
               (568, 192), (584, 192), (584, 320), (568, 320)]  # fmt: skip
    one = [(0, 1), (1, 2), (2, 16), (16, 17), (17, 3), (3, 4), (4, 5), (5, 6), (6, 7), (7, 8), (8, 18), (18, 19), (19, 9),
           (9, 10), (10, 11), (11, 0), (12, 13), (13, 14), (14, 15), (15, 12)]  # fmt: skip
    lines = np.zeros(len(one) + 2, LINE)
    lines["ends"] = [*one, (16, 19), (17, 18)]
    # The left room has sector 0, the door 1, the right room 2.
    sides = np.zeros(4, SIDE)
    sides["sector"] = [0, 1, 1, 2]
    lines["sides"] = [(0, NO_SIDE)] * len(one) + [(0, 1), (2, 3)]
    sectors = np.zeros(3, SECTOR)
    sectors["ceiling"] = [128, 0, 128]
    things = np.zeros(3, THING)
    things["place"], things["kind"] = [(96, 96), (960, 256), (100, 400)], [1, 11, 3004]
    vertices = np.array(corners, "<i2")
    contents = [b"", *(list.tobytes() for list in (things, lines, sides, vertices, sectors))]
    directory, data = b"", b""
    for name, content in zip(["E1M1", *LISTS], contents):
        directory += (12 + len(data)).to_bytes(4, "little") + len(content).to_bytes(4, "little") + name.encode().ljust(8, b"\0")
        data += content
    return b"PWAD" + len(contents).to_bytes(4, "little") + (12 + len(data)).to_bytes(4, "little") + data + directory


def main():
    import figure
    from visibility import Plan

    if len(sys.argv) > 2:
        with open(sys.argv[2], "rb") as file:
            data = file.read()
    else:
        data = made_up()
    walls, doors, starts = read(data, *sys.argv[3:4])
    # Doors are open or shut by turns: the picture has what is seen through open ones, paler.
    plan = Plan(np.concatenate([walls, doors]))
    picture, axes = figure.plan_axes(walls, "What is seen from the starts", size=(8, 5))
    open_areas = plan_areas = 0.0
    for start in starts:
        shut = plan.visibility_polygon(start)
        for number in range(len(walls), len(plan)):
            plan.set_opacity(number, "clear")
        figure.fill(axes, [plan.visibility_polygon(start)], figure.SEEN, alpha=0.35)
        open_areas += plan.visible_areas([start])[0]
        for number in range(len(walls), len(plan)):
            plan.set_opacity(number, "opaque")
        figure.fill(axes, [shut], figure.SEEN, alpha=0.5)
        plan_areas += plan.visible_areas([start])[0]
    for door in doors:
        axes.plot(*door.T, color=figure.MORE, zorder=4)
    figure.eyes(axes, starts)
    axes.set_xlabel("units of the map")
    print(f"{len(walls)} walls, {len(doors)} lines of doors, {len(starts)} starts")
    print(f"open doors show {open_areas - plan_areas:.0f} square units more than the {plan_areas:.0f} seen when shut")
    assert open_areas >= plan_areas
    figure.save(picture, "doom_map.png")


if __name__ == "__main__":
    main()
