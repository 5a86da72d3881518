"""A level of Quake 3 (.bsp) as a scene: what a player sees at a start, beside what is left to draw.

    python quake3_level.py PICTURES [FILE.bsp]

Without a file, it draws a small level of its own. Each polygon or mesh of the level is an object. Curved patches are
divided into triangles, and hide nothing, since the game divides them otherwise. Liquids, panes and sky hide nothing
either, nor do doors, lifts and other models that are not the world, since they may move or be invisible. Numpy reads the lists of a level as they are. Format: "Unofficial Quake 3 Map Specs", Kekoa Proudfoot.
"""

import re
import sys

import numpy as np

INCH = 0.0254  # metres; the unit of the game
TEXTURE = np.dtype([("name", "S64"), ("flags", "<u4"), ("contents", "<u4")])
VERTEX = np.dtype([("place", "<f4", 3), ("other", "V32")])
FACE = np.dtype([("texture", "<u4"), ("effect", "<i4"), ("kind", "<i4"), ("vertex", "<u4"), ("vertices", "<u4"),
                 ("index", "<u4"), ("indices", "<u4"), ("light", "V68"), ("size", "<u4", 2)])  # fmt: skip
MODEL = np.dtype([("box", "<f4", 6), ("face", "<u4"), ("faces", "<u4"), ("brushes", "V8")])
#: Numbers of the lists that are needed, among 17 in the header.
LISTS = {"entities": (0, np.dtype("u1")), "textures": (1, TEXTURE), "models": (7, MODEL), "vertices": (10, VERTEX), "indices": (11, np.dtype("<u4")), "faces": (13, FACE)}
POLYGON, PATCH, MESH = 1, 2, 3
SKY, NO_DRAW = 0x4, 0x80 | 0x200  # surface flags; not drawn, skipped
LIQUIDS, TRANSLUCENT = 0x8 | 0x10 | 0x20, 0x20000000  # contents
STEPS = 4  # along a side of three control points of a patch


def lists(data):
    """Returns the lists of a level by name."""
    if data[:4] != b"IBSP" or int.from_bytes(data[4:8], "little") != 46 or len(data) < 144:
        raise ValueError("no level of Quake 3: it does not begin with IBSP, 46")
    found = {}
    for name, (number, kind) in LISTS.items():
        start, size = (int.from_bytes(data[k : k + 4], "little") for k in (8 + 8 * number, 12 + 8 * number))
        if start + size > len(data) or size % kind.itemsize:
            raise ValueError(f"{name}: {size} bytes from {start} on are no whole number of items of the file")
        found[name] = np.frombuffer(data, kind, size // kind.itemsize, start)
    return found


def curve(points):
    """Returns points (3, k, 3) of quadratic curves at equal parameters, (STEPS + 1, k, 3)."""
    t = np.linspace(0, 1, STEPS + 1)[:, None, None]
    return (1 - t) ** 2 * points[0] + 2 * t * (1 - t) * points[1] + t**2 * points[2]


def grid(rows, columns):
    """Returns the triangles (n, 3) of a grid of vertices."""
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]
    return np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, c, b), (b, c, d))])


def patch(points, width, height):
    """Returns positions and triangles of a curved patch of width x height control points, both odd."""
    control = points.reshape(height, width, 3)
    pieces = []
    for row in range(0, height - 2, 2):
        for column in range(0, width - 2, 2):
            nine = curve(control[row : row + 3, column : column + 3])
            pieces.append(curve(nine.swapaxes(0, 1)).swapaxes(0, 1).reshape(-1, 3))
    one = grid(STEPS + 1, STEPS + 1)
    return np.concatenate(pieces), np.concatenate([one + k * len(pieces[0]) for k in range(len(pieces))])


def read(data):
    """Returns meshes (positions in metres, triangles, whether they hide) and the starts of players, (n, 3)."""
    level = lists(data)
    places = level["vertices"]["place"].astype(float) * INCH
    # The parts of all faces together are no more than the lists, so that a forged file takes no more than its size.
    for part, items in (("vertices", places), ("indices", level["indices"])):
        if level["faces"][part].sum(dtype=np.uint64) > 4 * len(items) + 4:
            raise ValueError(f"faces: they refer to more {part} than there are")
    # The first model is the world. Without it, nothing hides.
    world = np.zeros(len(level["faces"]), bool)
    for model in level["models"][:1]:
        first, count = int(model["face"]), int(model["faces"])
        if first + count > len(world):
            raise ValueError("models: the world has unknown faces")
        world[first : first + count] = True
    meshes = []
    for number, face in enumerate(level["faces"]):
        vertex, vertices, index, indices = (int(face[key]) for key in ("vertex", "vertices", "index", "indices"))
        width, height = map(int, face["size"])
        if vertex + vertices > len(places) or index + indices > len(level["indices"]) or face["texture"] >= len(level["textures"]):
            raise ValueError(f"faces: face {number} has unknown parts")
        texture = level["textures"][face["texture"]]
        if texture["flags"] & NO_DRAW or face["kind"] not in (POLYGON, PATCH, MESH):
            continue
        positions, hides = places[vertex : vertex + vertices], world[number] and face["kind"] != PATCH
        if face["kind"] == PATCH:
            if width * height != vertices or min(width, height) < 3 or width % 2 == 0 or height % 2 == 0:
                raise ValueError(f"faces: face {number} is no patch of {width} x {height} points")
            positions, triangles = patch(positions, width, height)
        else:
            triangles = level["indices"][index : index + indices].astype(np.int64)
            if len(triangles) % 3 or (len(triangles) and triangles.max() >= vertices):
                raise ValueError(f"faces: face {number} has unknown vertices")
            triangles = triangles.reshape(-1, 3)
        hides &= not (texture["flags"] & SKY or texture["contents"] & (LIQUIDS | TRANSLUCENT))
        if not np.isfinite(positions).all():
            raise ValueError(f"faces: face {number} has a corner that is no point")
        if len(triangles):
            meshes.append((positions, triangles, bool(hides)))
    text = level["entities"].tobytes().decode("latin-1")
    players = [block for block in text.split("}") if re.search(r'"classname"\s+"info_player', block)]
    origins = [re.search(r'"origin"\s+"(-?[\d.]+) (-?[\d.]+) (-?[\d.]+)"', block) for block in players]
    starts = [[float(number) * INCH for number in origin.groups()] for origin in origins if origin]
    return meshes, np.array(starts).reshape(-1, 3)


def made_up():
    """Makes a level of two rooms, a door slid aside between them, an arch and crates, for when there is none."""
    points, indices, faces = [], [], []

    def add(kind, corners, texture, triangles=(), size=(0, 0)):
        face = np.zeros((), FACE)
        face["texture"], face["kind"], face["vertex"], face["vertices"] = texture, kind, len(points), len(corners)
        face["index"], face["indices"], face["size"] = len(indices), len(triangles), size
        points.extend(corners), indices.extend(triangles), faces.append(face)

    def box(low, high):
        for axis in range(3):
            for side in (low, high):
                corners = np.array([low] * 4, float)
                others = [k for k in range(3) if k != axis]
                corners[:, axis] = side[axis]
                corners[[1, 2], others[0]], corners[[2, 3], others[1]] = high[others[0]], high[others[1]]
                add(POLYGON, corners.tolist(), 0, (0, 1, 2, 0, 2, 3))

    box((0, 0, 0), (1024, 512, 192))
    box((504, 0, 0), (520, 208, 192)), box((504, 304, 0), (520, 512, 192)), box((504, 208, 128), (520, 304, 192))
    for x, y in ((600, 60), (700, 400), (820, 120), (900, 300), (250, 60), (620, 430)):
        box((x, y, 0), (x + 48, y + 48, 48))
    arch = [(x, y, z) for y in (200, 256, 312) for x, z in ((560, 0), (590, 190), (620, 0))]
    add(PATCH, arch, 0, (), (3, 3))
    add(POLYGON, [(540, 330, 8), (1000, 330, 8), (1000, 490, 8), (540, 490, 8)], 1, (0, 1, 2, 0, 2, 3))
    world = len(faces)
    box((522, 304, 0), (530, 400, 128))
    models = np.array([((0,) * 6, 0, world, b""), ((0,) * 6, world, len(faces) - world, b"")], MODEL)
    textures = np.array([(b"textures/wall", 0, 1), (b"textures/water", 0, 0x20)], TEXTURE)
    vertices = np.zeros(len(points), VERTEX)
    vertices["place"] = points
    entities = b'{ "classname" "worldspawn" } { "classname" "info_player_deathmatch" "origin" "96 256 56" }'
    parts = {0: entities, 1: textures.tobytes(), 7: models.tobytes(), 10: vertices.tobytes(), 11: np.array(indices, "<u4").tobytes(), 13: np.array(faces, FACE).tobytes()}
    directory, body = b"", b""
    for number in range(17):
        part = parts.get(number, b"")
        directory += (144 + len(body)).to_bytes(4, "little") + len(part).to_bytes(4, "little")
        body += part
    return b"IBSP" + (46).to_bytes(4, "little") + directory + body


def main():
    import figure
    from visibility import Scene, View

    data = made_up()
    if len(sys.argv) > 2:
        with open(sys.argv[2], "rb") as file:
            data = file.read()
    meshes, starts = read(data)
    low = np.min([positions.min(axis=0) for positions, _, _ in meshes], axis=0)
    high = np.max([positions.max(axis=0) for positions, _, _ in meshes], axis=0)
    middle = (low + high) / 2
    scene = Scene(origin=tuple(middle), two_sided=True)
    for positions, triangles, hides in meshes:
        scene.add_mesh(np.ascontiguousarray(positions), np.ascontiguousarray(triangles), occluder=hides)
    eye = starts[0] if len(starts) else middle
    ahead = middle - eye if np.abs(middle - eye)[:2].max() > 0.1 else np.array([1.0, 0, 0])
    view = View.perspective(eye, eye + ahead * (1, 1, 0), fov_y=1.1, near=0.05)
    in_view, visible = scene.cull(view, occlusion=False), scene.cull(view)
    image = scene.item_buffer(view)
    missed, _ = scene.compare(view, visible)
    print(f"{len(scene)} objects, {len(in_view)} in the view, {len(visible)} to draw, {len(np.unique(image[image >= 0]))} seen")
    assert len(missed) == 0, "nothing that is seen is left out"

    picture, (screen, above) = figure.plt.subplots(1, 2, figsize=(13, 5), layout="constrained")
    colors = np.random.default_rng(2).uniform(0.3, 0.95, (len(scene) + 1, 3))
    colors[-1] = 1
    screen.imshow(colors[image])
    screen.set_title("What the player sees, a colour for each object")
    for number, (positions, triangles, _) in enumerate(meshes):
        color, order = (figure.MORE, 3) if number in visible else (figure.SEEN, 2) if number in in_view else ("#c8ccd4", 1)
        above.triplot(*positions[:, :2].T, triangles, color=color, lw=0.8, zorder=order)
    above.plot(*eye[:2], "o", color=figure.EYE, zorder=5)
    above.set_title("From above: to draw, in the view but hidden, elsewhere")
    above.set_aspect("equal")
    above.set_xlabel("m")
    figure.save(picture, "quake3_level.png")


if __name__ == "__main__":
    main()
