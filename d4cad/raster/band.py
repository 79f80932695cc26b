"""The raster of a program: the band of pixels near its boundary, and runs of inside pixels.

Outside the band coverage is 0 or 1, so a loss and its derivatives need only the band's pixels and, for the
rest, sums over runs of whole rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Coverage of a program on a canvas, and its derivative.

    shape: (height, width). row, col: (m,) the band's pixels. cover: (m,) their coverage. wound: (m,) uint8, 1 where the
    pixel's centre is inside. piece: (m,) int32, the primitive nearest to the pixel. slope: (m, k) derivative of the
    coverage by that primitive's k numbers. columns: (pieces, k) int64, the parameters that these numbers are (-1: fixed).
    spans: (s, 3) row, first and past-the-last column of runs of inside pixels, band included. size: number of parameters.
    """

    shape: tuple[int, int]
    row: NDArray[np.int32]
    col: NDArray[np.int32]
    cover: Floats
    wound: NDArray[np.uint8]
    piece: NDArray[np.int32]
    slope: Floats
    columns: NDArray[np.int64]
    spans: NDArray[np.int64]
    size: int

    @property
    def coverage(self) -> Floats:
        """Dense coverage (height, width) in [0, 1], row 0 lowest."""
        dense = np.zeros(self.shape)
        _fill(dense, self.spans, self.row, self.col, self.cover)
        return dense

    def pull_back(self, gradient: Floats) -> Floats:
        """Vector-Jacobian product: d/dcoverage (height, width) to d/dparams (size,)."""
        return np.asarray(_pull_back(gradient, self.row, self.col, self.piece, self.slope, self.columns, self.size))


@dataclass(frozen=True, slots=True, eq=False)
class SquaresTable:
    """A target with the sums that make the squared error cost only the band.

    target: (height, width). runs: (height, width + 1), the sum over columns < j of 1 - 2 target, which is what an
    inside pixel adds to the squared error. squares: likewise of target squared. total: the sum of target squared, the
    squared error of an empty shape.
    """

    target: Floats
    runs: Floats
    squares: Floats
    total: float

    @classmethod
    def of(cls, target: Floats) -> SquaresTable:
        """The table of ``target`` (height, width)."""
        target = np.ascontiguousarray(target, dtype=np.float64)
        runs, squares = np.zeros((2, target.shape[0], target.shape[1] + 1))
        np.cumsum(1 - 2 * target, axis=1, out=runs[:, 1:])
        np.cumsum(target * target, axis=1, out=squares[:, 1:])
        return cls(target, runs, squares, float(squares[:, -1].sum()))

    def value(self, band: Band) -> float:
        """Sum of squared errors of the band's program."""
        value = squared_error(
            self.target, self.runs, self.total, band.row, band.col, band.cover, band.wound, band.spans
        )  # fmt: skip
        return max(0.0, float(value))  # rounding can leave a perfect fit just under 0

    def normal(self, band: Band) -> tuple[float, Floats, Floats]:
        """Sum of squared errors, half its gradient J'r (n,), and the Gauss-Newton matrix J'J (n, n)."""
        gradient = np.zeros(band.size)
        matrix = np.zeros((band.size, band.size))
        value = normal_equations(
            self.target, self.runs, self.total, band.row, band.col, band.cover, band.wound, band.spans,
            band.piece, band.slope, band.columns, gradient, matrix,
        )  # fmt: skip
        return max(0.0, float(value)), gradient, matrix


@nb.njit(cache=True, error_model="numpy")
def _fill(dense, spans, row, col, cover):
    for k in range(spans.shape[0]):
        for j in range(spans[k, 1], spans[k, 2]):
            dense[spans[k, 0], j] = 1.0
    for s in range(row.shape[0]):
        dense[row[s], col[s]] = cover[s]


@nb.njit(cache=True, error_model="numpy")
def _pull_back(gradient, row, col, piece, slope, columns, size):
    out = np.zeros(size)
    for s in range(row.shape[0]):
        g = gradient[row[s], col[s]]
        p = piece[s]
        for k in range(slope.shape[1]):
            c = columns[p, k]
            if c >= 0:
                out[c] += g * slope[s, k]
    return out


@nb.njit(cache=True, error_model="numpy")
def squared_error(target, runs, total, row, col, cover, wound, spans):
    """Squared error: an empty shape's, plus the inside runs', corrected at the band's pixels."""
    value = total
    for k in range(spans.shape[0]):
        value += runs[spans[k, 0], spans[k, 2]] - runs[spans[k, 0], spans[k, 1]]
    for s in range(row.shape[0]):
        t = target[row[s], col[s]]
        hard = 1.0 - t if wound[s] else t
        soft = cover[s] - t
        value += soft * soft - hard * hard
    return value


@nb.njit(cache=True, error_model="numpy")
def normal_equations(target, runs, total, row, col, cover, wound, spans, piece, slope, columns, gradient, matrix):
    """Squared error; adds J'r to ``gradient`` (n,) and J'J to ``matrix`` (n, n), both given zeroed."""
    value = squared_error(target, runs, total, row, col, cover, wound, spans)
    pieces, width = columns.shape
    # Summed per piece first: its k numbers lie together, the parameters' columns do not.
    force = np.zeros((pieces, width))
    block = np.zeros((pieces, width, width))
    for s in range(row.shape[0]):
        residual = cover[s] - target[row[s], col[s]]
        p = piece[s]
        for k in range(width):
            j = slope[s, k]
            if j == 0.0:
                continue
            force[p, k] += j * residual
            for i in range(k + 1):
                block[p, k, i] += j * slope[s, i]
    for p in range(pieces):
        for k in range(width):
            c = columns[p, k]
            if c < 0:
                continue
            gradient[c] += force[p, k]
            for i in range(k + 1):
                other = columns[p, i]
                if other >= 0:
                    matrix[c, other] += block[p, k, i]
                    if i != k:
                        matrix[other, c] += block[p, k, i]
    return value
