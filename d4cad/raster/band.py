"""The raster of a program: the band of pixels near its boundary, and runs of inside pixels.

Outside the band coverage is 0 or 1, so a loss and its derivatives need only the band's pixels and, for the
rest, sums over runs of whole rows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numba as nb
import numpy as np
from numpy.typing import NDArray

from d4cad.program import Curvature

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NUMBERS = 5
"""The most numbers that determine a primitive: the width of ``slope`` and ``columns``, unused columns -1. A constant,
so that the kernels' inner loops unroll."""


class Chain(Protocol):
    """What lies between a program's parameters and its primitives' numbers where those are not parameters themselves.

    With J the derivative of all numbers by all parameters:
    """

    def pull_back(self, gradient: Floats) -> Floats:
        """J'f of a derivative f (size,) by the numbers, as ``columns`` counts them."""
        ...

    def curvature(self, blocks: Floats) -> Curvature:
        """J'BJ of one block (NUMBERS, NUMBERS) for each primitive, of which the lower half is given."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Coverage of a program on a canvas, and its derivative.

    A pixel whose coverage depends on several primitives takes as many entries, one after another, with the same
    coverage.

    shape: (height, width). row, col: (m,) the band's pixels. cover: (m,) their coverage. wound: (m,) uint8, 1 where the
    pixel lies in one of the spans. piece: (m,) int32, the primitive. slope: (m, NUMBERS) derivative of the coverage by
    that primitive's numbers. columns: (pieces, NUMBERS) int64, the parameters that these numbers are
    (-1: fixed). spans: (s, 3) row, first and past-the-last column of runs of inside pixels, which may hold pixels of
    the band. size: number of parameters. chain: how parameters make the numbers that columns and size count; None where
    those are the parameters. A band with a chain has one entry a pixel.
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
    chain: Chain | None = None

    @property
    def coverage(self) -> Floats:
        """Dense coverage (height, width) in [0, 1], row 0 lowest."""
        dense = np.zeros(self.shape)
        _fill(dense, self.spans, self.row, self.col, self.cover)
        return dense

    def pull_back(self, gradient: Floats) -> Floats:
        """Vector-Jacobian product: d/dcoverage (height, width) to d/dparams (size,)."""
        back = np.asarray(_pull_back(gradient, self.row, self.col, self.piece, self.slope, self.columns, self.size))
        return back if self.chain is None else self.chain.pull_back(back)


@dataclass(frozen=True, slots=True, eq=False)
class SquaresTable:
    """A target with the sums that make the squared error cost only the band.

    target: (height, width). runs: (height, width + 1), the sum over columns < j of 1 - 2 target, which is what an
    inside pixel adds to the squared error. squares: likewise of target squared. total: the sum of target squared, the
    squared error of an empty shape. slack: 0, or in [0, 1) for a target without grey, of which a pixel tells no more
    than on which side of 1/2 its coverage was. Of an error d then only what exceeds 1/2 counts in full, and d itself by
    the weight slack: (slack d^2 + max(d - 1/2, 0)^2) / (slack + 1/4), so that a wrong pixel costs 1 as it does
    otherwise.
    """

    target: Floats
    runs: Floats
    squares: Floats
    total: float
    slack: float = 0.0

    @classmethod
    def of(cls, target: Floats, slack: float = 0.0) -> SquaresTable:
        """The table of ``target`` (height, width)."""
        target = np.ascontiguousarray(target, dtype=np.float64)
        runs, squares = np.zeros((2, target.shape[0], target.shape[1] + 1))
        np.cumsum(1 - 2 * target, axis=1, out=runs[:, 1:])
        np.cumsum(target * target, axis=1, out=squares[:, 1:])
        return cls(target, runs, squares, float(squares[:, -1].sum()), slack)

    def value(self, band: Band) -> float:
        """Sum of squared errors of the band's program."""
        value = squared_error(
            self.target, self.runs, self.total, band.row, band.col, band.cover, band.wound, band.spans, self.slack
        )  # fmt: skip
        return max(0.0, float(value))  # rounding can leave a perfect fit just under 0

    def normal(self, band: Band) -> tuple[float, Floats, Floats | Curvature]:
        """Sum of squared errors, half its gradient J'r (n,), and the Gauss-Newton matrix J'J (n, n)."""
        if band.chain is not None:
            force, blocks = piece_equations(
                self.target, band.row, band.col, band.cover, band.piece, band.slope, len(band.columns), self.slack
            )  # fmt: skip
            numbers = np.zeros(band.size)
            numbers[band.columns[band.columns >= 0]] = force[band.columns >= 0]
            return self.value(band), band.chain.pull_back(numbers), band.chain.curvature(blocks)
        value, gradient, matrix = _normal(
            self.target, self.runs, self.total, band.row, band.col, band.cover, band.wound, band.spans,
            band.piece, band.slope, band.columns, band.size, self.slack,
        )  # fmt: skip
        return max(0.0, float(value)), gradient, matrix


@nb.njit(cache=True, error_model="numpy")
def _fill(dense: Floats, spans: Ints, row: NDArray[np.int32], col: NDArray[np.int32], cover: Floats) -> None:
    for k in range(spans.shape[0]):
        for j in range(spans[k, 1], spans[k, 2]):
            dense[spans[k, 0], j] = 1.0
    for s in range(row.shape[0]):
        dense[row[s], col[s]] = cover[s]


@nb.njit(cache=True, error_model="numpy")
def _pull_back(
    gradient: Floats,
    row: NDArray[np.int32],
    col: NDArray[np.int32],
    piece: NDArray[np.int32],
    slope: Floats,
    columns: Ints,
    size: int,
) -> Floats:
    out = np.zeros(size)
    for s in range(row.shape[0]):
        g = gradient[row[s], col[s]]
        p = piece[s]
        for k in range(NUMBERS):
            c = columns[p, k]
            if c >= 0:
                out[c] += g * slope[s, k]
    return out


@nb.njit(cache=True, inline="always", error_model="numpy")
def same_pixel(row: NDArray[np.int32], col: NDArray[np.int32], s: int) -> bool:
    """Whether entry s of a band is of the same pixel as the one before."""
    return s > 0 and col[s] == col[s - 1] and row[s] == row[s - 1]


@nb.njit(cache=True, inline="always", error_model="numpy")
def error_of(d: float, slack: float) -> float:
    """What a pixel that is off by d costs."""
    if slack == 0.0:
        return d * d
    over = max(abs(d) - 0.5, 0.0)
    return (slack * d * d + over * over) / (slack + 0.25)


@nb.njit(cache=True, inline="always", error_model="numpy")
def pull_of(d: float, slack: float) -> tuple[float, float]:
    """Half the derivative of :func:`error_of` by d, and half the second one."""
    if slack == 0.0:
        return d, 1.0
    over = abs(d) - 0.5
    if over <= 0.0:
        return slack * d / (slack + 0.25), slack / (slack + 0.25)
    return (slack * d + math.copysign(over, d)) / (slack + 0.25), (slack + 1.0) / (slack + 0.25)


@nb.njit(cache=True, error_model="numpy")
def squared_error(
    target: Floats,
    runs: Floats,
    total: float,
    row: NDArray[np.int32],
    col: NDArray[np.int32],
    cover: Floats,
    wound: NDArray[np.uint8],
    spans: Ints,
    slack: float,
) -> float:
    """Squared error, or that with ``slack``: an empty shape's, plus the inside runs', corrected at the band's
    pixels."""
    value = total
    for k in range(spans.shape[0]):
        value += runs[spans[k, 0], spans[k, 2]] - runs[spans[k, 0], spans[k, 1]]
    for s in range(row.shape[0]):
        if same_pixel(row, col, s):
            continue
        t = target[row[s], col[s]]
        hard = 1.0 - t if wound[s] else t
        value += error_of(cover[s] - t, slack) - hard * hard
    return value


@nb.njit(cache=True, error_model="numpy")
def _add_pair(slope: Floats, columns: Ints, s: int, p: int, t: int, q: int, weight: float, matrix: Floats) -> None:
    """Add to ``matrix`` what entries s and t of one pixel, of pieces p and q, have in common."""
    for k in range(NUMBERS):
        c = columns[p, k]
        if c < 0:
            continue
        for i in range(NUMBERS):
            d = columns[q, i]
            if d >= 0:
                both = weight * slope[s, k] * slope[t, i]
                matrix[c, d] += both
                matrix[d, c] += both


@nb.njit(cache=True, error_model="numpy")
def piece_equations(
    target: Floats,
    row: NDArray[np.int32],
    col: NDArray[np.int32],
    cover: Floats,
    piece: NDArray[np.int32],
    slope: Floats,
    pieces: int,
    slack: float,
) -> tuple[Floats, Floats]:
    """J'r (pieces, NUMBERS) and the lower half of J'J (pieces, NUMBERS, NUMBERS) by the numbers of each of the first
    ``pieces`` primitives, for the residual r = coverage - target; what two of them have in common is left out."""
    force = np.zeros((pieces, NUMBERS))
    block = np.zeros((pieces, NUMBERS, NUMBERS))
    for s in range(row.shape[0]):
        p = piece[s]
        if p >= pieces:
            continue
        pull, weight = pull_of(cover[s] - target[row[s], col[s]], slack)
        for k in range(NUMBERS):
            j = slope[s, k]
            force[p, k] += j * pull
            for i in range(k + 1):
                block[p, k, i] += weight * j * slope[s, i]
    return force, block


@nb.njit(cache=True, error_model="numpy")
def add_normal_equations(
    target: Floats,
    row: NDArray[np.int32],
    col: NDArray[np.int32],
    cover: Floats,
    piece: NDArray[np.int32],
    slope: Floats,
    columns: Ints,
    gradient: Floats,
    matrix: Floats,
    slack: float,
) -> None:
    """Add J'r to ``gradient`` (n,) and J'J to ``matrix`` (n, n) for the residual r = coverage - target.

    columns: (pieces, NUMBERS); pixels of other pieces than these are left out.
    """
    pieces = columns.shape[0]
    # Summed per piece first: its numbers lie together, the parameters' columns do not.
    force, block = piece_equations(target, row, col, cover, piece, slope, pieces, slack)
    for s in range(1, row.shape[0]):
        t = s
        while piece[s] < pieces and same_pixel(row, col, t):
            t -= 1
            if piece[t] < pieces:
                _, weight = pull_of(cover[s] - target[row[s], col[s]], slack)
                _add_pair(slope, columns, s, piece[s], t, piece[t], weight, matrix)
    for p in range(pieces):
        for k in range(NUMBERS):
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


@nb.njit(cache=True, error_model="numpy")
def _normal(
    target: Floats,
    runs: Floats,
    total: float,
    row: NDArray[np.int32],
    col: NDArray[np.int32],
    cover: Floats,
    wound: NDArray[np.uint8],
    spans: Ints,
    piece: NDArray[np.int32],
    slope: Floats,
    columns: Ints,
    size: int,
    slack: float,
) -> tuple[float, Floats, Floats]:
    gradient = np.zeros(size)
    matrix = np.zeros((size, size))
    add_normal_equations(target, row, col, cover, piece, slope, columns, gradient, matrix, slack)
    return squared_error(target, runs, total, row, col, cover, wound, spans, slack), gradient, matrix
