"""Which rooms of a house see the garden, and how much of it each place in them sees.

Usage: python garden_rooms.py [HOUSE.ifc] [FOLDER] [HEIGHT], with the folder for the picture, and the height of eyes in
metres above the ground floor, 1.5 if none is given. Needs the package ifcopenshell. Walls and all else that hides are cut
at that height; one sees through windows and doors. Rooms are the file's spaces, and the garden is what is outside, under
the open sky: on the site where it has a body, and at most 12 m from the rooms.

Without a file, a house that is written here becomes one, and is read back; without ifcopenshell, its plan is drawn at once.
"""

import sys
import tempfile
from pathlib import Path

import figure
import numpy as np
from visibility import Plan, Scene, View

# The house: centre lines of walls, rooms between them, openings in them, in metres. The garden is in front of it, y < 0,
# with a hedge around and a shed in it.
WALLS = [
    [(0, 0), (10, 0)], [(10, 0), (10, 9)], [(0, 9), (10, 9)], [(0, 0), (0, 9)],
    [(6, 0), (6, 9)], [(0, 5), (6, 5)], [(3, 5), (3, 9)], [(6, 4), (10, 4)],
]  # fmt: skip
ROOMS = {
    "living room": [(0, 0), (6, 5)],
    "kitchen": [(6, 0), (10, 4)],
    "hall": [(6, 4), (10, 9)],
    "study": [(0, 5), (3, 9)],
    "bath": [(3, 5), (6, 9)],
}
WINDOWS = [[(1, 0), (5, 0)], [(7, 0), (8, 0)], [(4, 9), (5, 9)]]
DOORS = [
    [(6, 1.5), (6, 2.5)],  # from living room to kitchen
    [(8.5, 4), (9.5, 4)],  # from kitchen to hall
    [(1, 5), (2, 5)],  # from living room to study
    [(6, 7), (6, 8)],  # from hall to bath
    [(8, 9), (9, 9)],  # from hall to the street
]
LOT, SHED = [(-2, -12), (12, 0)], [(7, -9), (11, -6)]
HEDGE = [[(-2, 0), (-2, -12)], [(-2, -12), (12, -12)], [(12, -12), (12, 0)]]
HIGH, THICK = 2.6, 0.2
#: Metres between places in rooms, between spots of the garden, and around the rooms.
STEP, SPOT, REACH = 0.2, 0.5, 12.0


def box(ends, bottom, top, thick=0.0):
    """Returns the corners of what stands on a line or a rectangle along the axes, thickened to all sides."""
    ends = np.sort(np.asarray(ends, float), axis=0) + [[-thick / 2], [thick / 2]]
    return (*ends[0], bottom), (*ends[1], top)


def hole(ends, bottom, top):
    """Returns the corners of an opening, which is as thick as the wall and no wider than its ends."""
    low, high = map(np.array, box(ends, bottom, top))
    across = int(low[1] == high[1])
    low[across], high[across] = low[across] - THICK / 2, high[across] + THICK / 2
    return low, high


def write(path):
    """Writes the house as an IFC file."""
    from ifc_house import House

    house = House()
    house.shape(house.site, *box(LOT, -0.5, 0.0))
    walls = [(wall, house.add("IfcWall", "wall", *box(wall, 0, HIGH, THICK))) for wall in WALLS]
    for kind, openings, bottom, top in ("IfcWindow", WINDOWS, 0.9, 2.2), ("IfcDoor", DOORS, 0.0, 2.1):
        for ends in openings:
            axis = int(ends[0][0] == ends[1][0])
            cut = [body for wall, body in walls if wall[0][1 - axis] == wall[1][1 - axis] == ends[0][1 - axis]]
            house.open(cut, kind, kind[3:].lower(), *hole(ends, bottom, top))
    for name, room in ROOMS.items():
        house.add("IfcSpace", name, *box(room, 0, HIGH, -THICK))
    house.add("IfcSlab", "floor", *box([(0, 0), (10, 9)], -0.3, 0, THICK))
    house.add("IfcRoof", "roof", *box([(0, 0), (10, 9)], HIGH, HIGH + 0.3, 0.8))
    house.add("IfcBuildingElementProxy", "shed", *box(SHED, 0, 2.4))
    for ends in HEDGE:
        house.add("IfcBuildingElementProxy", "hedge", *box(ends, 0, 1.8, THICK))
    house.file.write(str(path))


def grid(low, high, step):
    """Returns points (rows, columns, 2) in the middles of squares that cover a rectangle."""
    x, y = (np.arange(start + step / 2, end + step / 2, step) for start, end in zip(low, high))
    return np.stack(np.meshgrid(x, y), axis=-1)


def inside(points, outline):
    """Tells of points (n, 2) which are inside outlines, segments (k, 2, 2) in any order: by counting crossings."""
    (x, y), (start, end) = points.T[..., None], np.swapaxes(outline, 0, 1)
    crosses = (start[:, 1] > y) != (end[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = start[:, 0] + (y - start[:, 1]) / (end[:, 1] - start[:, 1]) * (end[:, 0] - start[:, 0])
    return (crosses & (at > x)).sum(axis=1) % 2 == 1


def read(path, above):
    """Reads a house. Returns its plan, pairs of the name and the outline of rooms, and spots of the garden (n, 2)."""
    import ifcopenshell
    from ifcopenshell.util.placement import get_local_placement
    from ifcopenshell.util.unit import calculate_unit_scale

    model = ifcopenshell.open(str(path))
    storeys = sorted(model.by_type("IfcBuildingStorey"), key=lambda storey: abs(storey.Elevation or 0.0))
    floor = get_local_placement(storeys[0].ObjectPlacement)[2, 3] * calculate_unit_scale(model) if storeys else 0.0
    height = floor + above
    plan, spaces = Plan.from_ifc(model, height)
    if not spaces:
        sys.exit(f"{path}: no spaces at {height:.2f} m")
    rooms = [(model.by_guid(guid), outline) for guid, outline in spaces.items()]
    rooms = [(getattr(space, "LongName", None) or space.Name or "room", outline) for space, outline in rooms]

    # Pictures without perspective, down and up: a spot of the garden has ground below and nothing above.
    scene, guids = Scene.from_ifc(model)
    ends = np.concatenate([outline.reshape(-1, 2) for _, outline in rooms])
    spots = grid(ends.min(axis=0) - REACH, ends.max(axis=0) + REACH, SPOT)
    below, above = (look(scene, spots, height, direction) for direction in (-1, 1))
    has_site = any(model.by_guid(guid).is_a("IfcSite") for guid in guids)
    return plan, rooms, spots[(above < 0) & ((below >= 0) | (not has_site))]


def look(scene, spots, height, direction):
    """Returns the object that is nearest below each spot of a grid at a height, or above it; -1 where there is none."""
    rows, columns, _ = spots.shape
    eye = (*spots.mean(axis=(0, 1)), height)
    target = (*eye[:2], height + direction)
    view = View.orthographic(eye, target, columns * SPOT, rows * SPOT, up=(0, 1, 0), near=1e-3)
    # Rows of a picture go down, which is to lower y. Up there, +x is to the left.
    return scene.item_buffer(view, size=(columns, rows))[::-1, ::-direction]


def written():
    """Returns what `read` does, of the plan that is written here."""

    def cut(wall):
        """Returns the pieces of a wall between its openings."""
        axis = int(wall[0][0] == wall[1][0])
        on = [ends for ends in WINDOWS + DOORS if ends[0][1 - axis] == ends[1][1 - axis] == wall[0][1 - axis]]
        gaps = [end for ends in on for end in ends if wall[0][axis] <= end[axis] <= wall[1][axis]]
        ends = sorted([*wall, *gaps], key=lambda end: end[axis])
        return list(zip(ends[::2], ends[1::2]))

    def outline(ends):
        (left, bottom), (right, top) = ends
        corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
        return np.array(list(zip(corners, corners[1:] + corners[:1])), dtype=float)

    walls = [piece for wall in WALLS for piece in cut(wall)]
    plan = Plan(np.array([*walls, *HEDGE, *outline(SHED)], dtype=float))
    spots = grid(*LOT, SPOT).reshape(-1, 2)
    return plan, [(name, outline(room)) for name, room in ROOMS.items()], spots[~inside(spots, outline(SHED))]


def main():
    house = sys.argv.pop(1) if len(sys.argv) > 1 and sys.argv[1].lower().endswith(".ifc") else None
    above = float(sys.argv[2]) if len(sys.argv) > 2 else 1.5
    if house is not None:
        plan, rooms, spots = read(house, above)
    else:
        try:
            with tempfile.TemporaryDirectory() as folder:
                write(Path(folder, "house.ifc"))
                plan, rooms, spots = read(Path(folder, "house.ifc"), above)
        except ImportError:
            print("ifcopenshell is not there: the plan of the house is used as it is written here")
            plan, rooms, spots = written()
    if not len(spots):
        sys.exit("no garden: nothing is under the open sky")

    ends = np.concatenate([outline.reshape(-1, 2) for _, outline in rooms])
    low, high = ends.min(axis=0), ends.max(axis=0)
    places = grid(low, high, STEP)
    shares = np.full(places.shape[:2], np.nan)
    picture, axes = figure.plan_axes(plan.walls, "Garden seen from each place of the house", size=(7, 8))
    # Of each room what its best place sees, and the middle of the room that sees most.
    most, best = {}, (0.0, *places[0, 0])
    for name, outline in rooms:
        within = inside(places.reshape(-1, 2), outline).reshape(shares.shape)
        own = places[within]
        if not len(own):
            continue
        seen = plan.sees(np.repeat(own, len(spots), axis=0), np.tile(spots, (len(own), 1)))
        share = seen.reshape(len(own), len(spots)).mean(axis=1)
        shares[within] = share
        most[name] = max(share.max(), most.get(name, 0.0))
        middle = own[np.linalg.norm(own - own.mean(axis=0), axis=1).argmin()]
        best = max(best, (share.mean(), *middle))
        print(f"{name:14} {100 * (share > 0).mean():5.1f} % of it sees some of the garden, at most {100 * share.max():4.1f} %")
        axes.text(middle[0], middle[1] + 0.2, name, ha="center", va="bottom", zorder=6)
    if house is None:
        # The bath's window is to the street.
        assert most["living room"] > 0.5 and most["hall"] > 0 and most["bath"] == 0, most

    x, y = np.transpose([low, high])
    drawn = axes.imshow(shares, extent=(*x, *y), origin="lower", cmap="YlGn", vmin=0, zorder=0)
    figure.fill(axes, [plan.visibility_polygon(best[1:])], figure.SEEN, alpha=0.35)
    figure.eyes(axes, np.array([best[1:]]))
    axes.plot(*spots.T, ".", color="#70a37f", markersize=1.5, zorder=0)
    picture.colorbar(drawn, ax=axes, label="share of the garden seen", shrink=0.7)
    bounds = np.concatenate([ends, spots])
    axes.set_xlim(bounds[:, 0].min() - 0.5, bounds[:, 0].max() + 0.5)
    axes.set_ylim(bounds[:, 1].min() - 0.5, bounds[:, 1].max() + 0.5)
    figure.save(picture, "garden_rooms.png")


if __name__ == "__main__":
    main()
