"""Types of the native part. Shapes are in comments; lengths are in metres, angles in radians."""

from collections.abc import Sequence
from typing import Literal, final, overload

import numpy as np
from numpy.typing import NDArray

Float = np.float64
# float64 array of the shape that the comment says, or nested sequences of numbers, which are copied.
Floats = NDArray[np.float64] | Sequence[object]
# uint32, int32 or int64 array, or a sequence of integers.
Indices = NDArray[np.integer] | Sequence[object]
Heights = NDArray[np.float64] | NDArray[np.float32] | NDArray[np.int16] | Sequence[Sequence[float]]
Point2 = Sequence[float] | NDArray[np.float64]
Point3 = Sequence[float] | NDArray[np.float64]
Boxes = NDArray[np.float64] | Sequence[object]
# What removes hidden objects from those in the view: see Scene.cull. Axes up: z of "horizon", y of "horizon_y".
Culler = Literal["z_buffer", "horizon", "horizon_y", "occlusion_tree"] | Cells

def viewshed(
    heights: Heights,  # (rows, columns)
    observer: Point2,  # row, column
    *,
    cell_size: float | tuple[float, float] = 1.0,
    observer_height: float = 1.8,
    target_height: float = 0.0,
    max_distance: float = ...,
    curvature: float = 0.0,
) -> NDArray[np.bool_]: ...  # (rows, columns)
def hidden_heights(
    heights: Heights,  # (rows, columns)
    observer: Point2,  # row, column
    *,
    cell_size: float | tuple[float, float] = 1.0,
    observer_height: float = 1.8,
    max_distance: float = ...,
    curvature: float = 0.0,
) -> NDArray[np.float64]: ...  # (rows, columns)
def viewshed_count(
    heights: Heights,  # (rows, columns)
    observers: Floats,  # (n, 2)
    *,
    cell_size: float | tuple[float, float] = 1.0,
    observer_height: float = 1.8,
    target_height: float = 0.0,
    max_distance: float = ...,
    curvature: float = 0.0,
    threads: int | None = None,
) -> NDArray[np.uint32]: ...  # (rows, columns)

class Plan:
    def __new__(cls, walls: Floats, *, margin: float | None = None) -> Plan: ...  # (n, 2, 2)
    def __len__(self) -> int: ...
    @property
    def walls(self) -> NDArray[np.float64]: ...  # (n, 2, 2)
    @property
    def bounds(self) -> NDArray[np.float64]: ...  # (2, 2)
    def set_opacity(self, wall: int, opacity: Literal["opaque", "clear", "one_way"]) -> None: ...
    def visibility_polygon(
        self,
        eye: Point2,
        *,
        range: float = ...,
        sector: tuple[Point2, Point2] | None = None,
        through: int = 0,
    ) -> NDArray[np.float64]: ...  # (k, 2)
    def visible_walls(
        self,
        eye: Point2,
        *,
        range: float = ...,
        sector: tuple[Point2, Point2] | None = None,
        through: int = 0,
    ) -> NDArray[np.uint32]: ...  # (k,)
    def visible_areas(self, eyes: Floats, *, range: float = ...) -> NDArray[np.float64]: ...  # (n, 2) -> (n,)
    def sees(self, a: Floats, b: Floats) -> NDArray[np.bool_]: ...  # (n, 2), (n, 2) -> (n,)
    def rays(
        self, eyes: Floats, through: Floats
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]: ...  # (n, 2), (n, 2) -> (n, 2), (n,)
    def seen_from_region(
        self, points: Floats
    ) -> tuple[NDArray[np.uint32], NDArray[np.float64]]: ...  # (n, 2) -> (k,), (m, 3, 2)
    def guards(
        self, starts: Floats
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...  # (n, 2) -> (g, 2), (w, 2)
    def unseen(self, starts: Floats) -> UnseenRegion: ...  # (n, 2)
    def shortest_path(self, start: Point2, end: Point2) -> NDArray[np.float64] | None: ...  # (k, 2)

@final
class UnseenRegion:
    @property
    def area(self) -> float: ...
    def look(self, eye: Point2) -> None: ...
    def gains(self, eyes: Floats) -> NDArray[np.float64]: ...  # (n, 2) -> (n,)
    def polygons(self) -> list[NDArray[np.float64]]: ...  # each (k, 2)
    def contains(self, points: Floats) -> NDArray[np.bool_]: ...  # (n, 2) -> (n,)
    def copy(self) -> UnseenRegion: ...

@final
class View:
    @staticmethod
    def perspective(
        eye: Point3,
        target: Point3,
        *,
        up: Point3 = (0.0, 0.0, 1.0),
        fov_y: float = 1.0,
        aspect: float = ...,
        near: float = 0.1,
        far: float = ...,
    ) -> View: ...
    @staticmethod
    def orthographic(
        eye: Point3,
        target: Point3,
        width: float,
        height: float,
        *,
        up: Point3 = (0.0, 0.0, 1.0),
        near: float = 0.1,
        far: float = 1000.0,
    ) -> View: ...
    @staticmethod
    def from_matrix(
        matrix: Floats,  # (4, 4)
        *,
        depth: Literal["negative_one_to_one", "zero_to_one", "reversed"] = "negative_one_to_one",
    ) -> View: ...

class Scene:
    def __new__(cls, *, origin: Point3 = (0.0, 0.0, 0.0), two_sided: bool = False) -> Scene: ...
    def __len__(self) -> int: ...
    def add_boxes(self, boxes: Boxes, *, solid: bool = True) -> NDArray[np.uint32]: ...  # (n, 2, 3) -> (n,)
    def add_mesh(
        self,
        positions: Floats,  # (n, 3)
        triangles: Indices,  # (m, 3)
        *,
        occluder: bool = True,
        two_sided: bool | None = None,
    ) -> int: ...
    def move_boxes(self, ids: Indices, boxes: Boxes) -> None: ...  # (n,), (n, 2, 3)
    @property
    def bounds(self) -> NDArray[np.float64]: ...  # (n, 2, 3)
    def join_occluders(self) -> int: ...
    def make_cells(self, *, max_cells: int = 16384) -> Cells: ...
    @overload
    def cull(
        self, view: View, *, occlusion: bool | Culler | Sequence[Culler] | None = True, mask: Literal[False] = False
    ) -> NDArray[np.uint32]: ...  # (k,)
    @overload
    def cull(
        self, view: View, *, occlusion: bool | Culler | Sequence[Culler] | None = True, mask: Literal[True]
    ) -> NDArray[np.bool_]: ...  # (n,)
    def seen_from_region(self, region: Floats) -> NDArray[np.uint32]: ...  # (2, 3) -> (k,)
    def prove_from_region(
        self, region: Floats, *, clearance: float = 1e-4
    ) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float64]]: ...
    # (2, 3) -> seen (k,), hidden (h,), undecided (u,), lines of sight (k, 2, 3)
    def bake(self, cells: Boxes, *, clearance: float = 1e-4, gap: float = 0.02) -> BakedSet: ...  # (n, 2, 3)
    @staticmethod
    def grid_cells(
        region: tuple[Point3, Point3], size: Point3
    ) -> NDArray[np.float64]: ...  # (n, 2, 3)
    def item_buffer(
        self, view: View, size: tuple[int, int] = (640, 360)
    ) -> NDArray[np.int64]: ...  # (height, width)
    def compare(
        self, view: View, ids: Indices, size: tuple[int, int] = (640, 360)
    ) -> tuple[NDArray[np.uint32], int]: ...

@final
class Cells:
    def __new__(
        cls,
        boxes: Boxes,  # (n, 2, 3)
        portals: Sequence[Floats],  # m arrays, each (k, 3)
        joins: Indices,  # (m, 2)
        *,
        planes: Sequence[Floats] | None = None,  # n arrays, each (k, 4)
        tolerance: float = 1e-6,
    ) -> Cells: ...
    @staticmethod
    def read_prt(
        text: str,
    ) -> tuple[int, list[NDArray[np.float64]], NDArray[np.uint32]]: ...  # cells, m arrays (k, 3), (m, 2)
    def __len__(self) -> int: ...
    @property
    def portals(self) -> list[NDArray[np.float64]]: ...  # m arrays, each (k, 3)
    @property
    def joins(self) -> NDArray[np.uint32]: ...  # (m, 2)
    def locate(self, points: Floats) -> NDArray[np.int64]: ...  # (n, 3) -> (n,)
    def set_open(self, portal: int, open: bool) -> None: ...
    def set_passage(self, portal: int, passage: Literal["both", "forward", "backward"]) -> None: ...
    def sees(self, a: Indices, b: Indices) -> NDArray[np.bool_]: ...  # (n,), (n,) -> (n,)
    def bake(self) -> None: ...

@final
class BakedSet:
    @staticmethod
    def from_bytes(data: bytes) -> BakedSet: ...
    def to_bytes(self) -> bytes: ...
    def __len__(self) -> int: ...
    def row(self, cell: int) -> NDArray[np.uint32]: ...  # (k,)
    def locate(self, points: Floats) -> NDArray[np.int64]: ...  # (n, 3) -> (n,)
