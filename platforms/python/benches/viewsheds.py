"""Viewsheds beside xarray-spatial and gdal_viewshed, on the same hills in one run: time, and which cells differ.

Usage: python viewsheds.py [SIZE...], with xarray-spatial installed and gdal_viewshed and gdal_translate on the path;
what is missing is left out.

The others answer other questions. Both compare the target with heights interpolated along the line of sight in their
own ways, on no surface of triangles. So the judge here is ours by brute force for a sample of cells: all edges of the
surface that a line of sight crosses, in numpy, in double precision and without our code.
"""

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import visibility

CELL, EYE = 30.0, 10.0


def hills(size, seed=3):
    """Returns heights of hills in metres: noise whose height falls with its frequency."""
    random = np.random.default_rng(seed)
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
    frequency[0, 0] = np.inf
    heights = np.fft.ifft2(np.fft.fft2(random.normal(size=(size, size))) * frequency**-2.1).real
    return (600 * (heights - heights.min()) / np.ptp(heights)).astype(np.float32)


def excess(heights, eye, row, column):
    """By how many metres the surface rises above the line of sight, negative if the sample is seen."""
    start, end = np.array(eye[:2], float), np.array([row, column], float)
    step = end - start
    shares = []
    # Where the segment crosses rows, columns and diagonals (row - column whole).
    for line in (np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.array([1.0, -1.0])):
        a, b = line @ start, line @ end
        if a != b:
            whole = np.arange(np.floor(min(a, b)) + 1, np.ceil(max(a, b)))
            shares.append((whole - a) / (b - a))
    shares = np.concatenate(shares)
    points = start + shares[:, None] * step
    cell = np.clip(np.floor(points + 1e-9), 0, np.array(heights.shape) - 2).astype(int)
    down, across = (points - cell).T
    r, c = cell.T
    z = heights.astype(float)
    low, side, far = z[r, c], np.where(across >= down, z[r, c + 1], z[r + 1, c]), z[r + 1, c + 1]
    ground = low + np.maximum(across, down) * (side - low) + np.minimum(across, down) * (far - side)
    sight = eye[2] + shares * (float(heights[row, column]) - eye[2])
    return (ground - sight).max() if len(shares) else -np.inf


def best_of(call, times=3):
    """Returns the least time in seconds of a few calls, and the last answer."""
    least = np.inf
    for _ in range(times):
        start = time.perf_counter()
        answer = call()
        least = min(least, time.perf_counter() - start)
    return least, answer


def with_xarray_spatial(heights, observer):
    import xarray
    from xrspatial import viewshed

    rows, columns = heights.shape
    y, x = np.arange(rows) * CELL, np.arange(columns) * CELL
    raster = xarray.DataArray(heights.astype(float), coords={"y": y, "x": x}, dims=("y", "x"))
    row, column = observer
    call = lambda: viewshed(raster, x=column * CELL, y=row * CELL, observer_elev=EYE)  # noqa: E731
    seconds, answer = best_of(call)
    return seconds, answer.values >= 0


def with_gdal(heights, observer):
    rows, columns = heights.shape
    row, column = observer
    with tempfile.TemporaryDirectory() as folder:
        raw, tif, out = (str(Path(folder) / name) for name in ("dem.bin", "dem.tif", "out.tif"))
        heights.astype("<f4").tofile(raw)
        Path(folder, "dem.hdr").write_text(
            f"ENVI\nsamples = {columns}\nlines = {rows}\nbands = 1\ndata type = 4\ninterleave = bsq\nbyte order = 0\n"
        )
        # Samples are cells' middles.
        corners = [-CELL / 2, CELL / 2, (columns - 0.5) * CELL, -(rows - 0.5) * CELL]
        place = ["-a_ullr", *map(str, corners)]
        subprocess.run(["gdal_translate", "-q", "-of", "GTiff", *place, raw, tif], check=True)
        at = ["-ox", str(column * CELL), "-oy", str(-row * CELL), "-oz", str(EYE), "-tz", "0", "-md", "0", "-cc", "0"]
        command = ["gdal_viewshed", "-q", "-f", "ENVI", *at, tif, str(Path(folder) / "seen.bin")]
        seconds, _ = best_of(lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL))
        seen = np.fromfile(Path(folder) / "seen.bin", dtype=np.uint8).reshape(rows, columns)
        del out
        return seconds, seen > 0


def main():
    sizes = [int(size) for size in sys.argv[1:]] or [500, 1000, 2000]
    print("| samples | program | time, s | seen | of sampled cells: hidden by mistake, shown by mistake |")
    print("|---:|---|---:|---:|---:|")
    for size in sizes:
        heights = hills(size)
        middle = slice(size // 3, 2 * size // 3)
        summit = np.unravel_index(heights[middle, middle].argmax(), heights[middle, middle].shape)
        observer = tuple(int(index) + size // 3 for index in summit)
        eye = (*observer, float(heights[observer]) + EYE)
        programs = {"visibility": lambda: best_of(lambda: visibility.viewshed(heights, observer, cell_size=CELL, observer_height=EYE))}
        try:
            import xrspatial  # noqa: F401

            programs["xarray-spatial"] = lambda: with_xarray_spatial(heights, observer)
        except ImportError:
            print("xarray-spatial is not there", file=sys.stderr)
        if shutil.which("gdal_viewshed"):
            programs["gdal_viewshed"] = lambda: with_gdal(heights, observer)
        else:
            print("gdal_viewshed is not there", file=sys.stderr)
        random = np.random.default_rng(1)
        cells = random.integers(0, size, (4000, 2))
        over = np.array([excess(heights, eye, *cell) for cell in cells])
        # Single precision of heights leaves millimetres; the cells between are nobody's mistake.
        surely_seen, surely_hidden = over < -1e-6, over > 1e-6
        for name, run in programs.items():
            seconds, seen = run()
            sampled = seen[tuple(cells.T)]
            wrong = (surely_seen & ~sampled).sum(), (surely_hidden & sampled).sum()
            print(f"| {size}^2 | {name} | {seconds:.3f} | {100 * seen.mean():.2f} % | {wrong[0]}, {wrong[1]} of {len(cells)} |")


if __name__ == "__main__":
    main()
