"""Edges as the raster takes them, compiled: constants of each, its distance from a point, its monotone pieces.

Everything here is in pixels: pixel (row, col) has its centre at (col + 0.5, row + 0.5), y up. An edge runs
from vertex i to vertex nxt[i] with bulge b[i] = tan(sweep / 4); 0 is a line. No formula here divides by the
bulge: with u along the chord from its start and v to the right of travel, the edge's circle is

    f(u, v) = 2 b (u^2 - u L + v^2) + L (1 - b^2) v = 0,    |grad f| = L (1 + b^2) + 4 b d at the distance d from it

which at b = 0 is the chord's line. f > 0 to the right of travel for either sign of b.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from numpy.typing import NDArray

X0, Y0, CX, SX, LENGTH, BULGE, COS, SIN, RADIUS, FLAT, PER_LENGTH, PER_RADIUS = range(12)
"""Columns of the edge table: start, unit chord, chord length L, bulge, cosine and sine of half the sweep,
L (1 + b^2) / 2 and L (1 - b^2) / 2, and the inverses of L and of L (1 + b^2) / 2."""

COLUMNS = 12
"""Number of columns of the edge table."""

AT_EDGE, AT_START, AT_END = 0, 1, 2
"""What a pixel is nearest to: the inside of its edge, or one of its vertices."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@nb.njit(cache=True, inline="always", error_model="numpy")
def distance(
    u: float, v: float, length: float, b: float, cos: float, sin: float, radius: float, flat: float
) -> tuple[float, int]:
    """Signed distance to an edge's curve (> 0 right of travel) from the chord frame, and where its foot lies.

    At a vertex the distance is to that vertex, unsigned. The sector of an arc over half a turn is the union, of
    a lesser one the intersection, of the half-planes that its end normals bound.
    """
    after = u * cos + v * sin >= 0.0
    before = (u - length) * cos - v * sin <= 0.0
    if (after and before) or ((after or before) and abs(b) > 1.0):
        if b == 0.0:
            return v, AT_EDGE
        f = 2.0 * (b * (u * (u - length) + v * v) + flat * v)
        across, along = b * (2.0 * u - length), 2.0 * b * v + flat
        return f / (radius + math.sqrt(across * across + along * along)), AT_EDGE
    to_start = u * u + v * v
    to_end = (u - length) * (u - length) + v * v
    if to_start <= to_end:
        return math.sqrt(to_start), AT_START
    return math.sqrt(to_end), AT_END


@nb.njit(cache=True, error_model="numpy")
def fill_edge(table: Floats, e: int, x0: float, y0: float, x1: float, y1: float, b: float) -> None:
    """Constants of one edge into row e of the edge table. A chord under 1e-9 px counts as 1e-9 px long."""
    dx = x1 - x0
    dy = y1 - y0
    length = math.sqrt(dx * dx + dy * dy)
    if length < 1e-9:
        dx, dy, length = 1e-9, 0.0, 1e-9
    bb = b * b
    table[e, X0] = x0
    table[e, Y0] = y0
    table[e, CX] = dx / length
    table[e, SX] = dy / length
    table[e, LENGTH] = length
    table[e, BULGE] = b
    table[e, COS] = (1.0 - bb) / (1.0 + bb)
    table[e, SIN] = 2.0 * b / (1.0 + bb)
    table[e, RADIUS] = 0.5 * length * (1.0 + bb)
    table[e, FLAT] = 0.5 * length * (1.0 - bb)
    table[e, PER_LENGTH] = 1.0 / length
    table[e, PER_RADIUS] = 2.0 / (length * (1.0 + bb))


@nb.njit(cache=True, error_model="numpy")
def edge_table(x: Floats, y: Floats, b: Floats, nxt: Ints) -> Floats:
    """Constants of every edge, (n, COLUMNS), columns as named above."""
    n = x.shape[0]
    table = np.empty((n, COLUMNS))
    for e in range(n):
        fill_edge(table, e, x[e], y[e], x[nxt[e]], y[nxt[e]], b[e])
    return table


@nb.njit(cache=True, inline="always", error_model="numpy")
def _turns_past_an_axis(table: Floats, e: int) -> bool:
    """Whether an arc may run level or upright inside: for a sweep of at most half a turn, if the tangents at both ends
    lie in different quadrants."""
    b, cos, sin, cx, sx = table[e, BULGE], table[e, COS], table[e, SIN], table[e, CX], table[e, SX]
    if abs(b) <= 1e-15:  # nowhere further from its chord than rounding
        return False
    level = (cx * cos + sx * sin) * (cx * cos - sx * sin)
    upright = (sx * cos - cx * sin) * (sx * cos + cx * sin)
    return abs(b) > 1.0 or not (level > 0.0 and upright > 0.0)


@nb.njit(cache=True, error_model="numpy")
def cut_edge(table: Floats, e: int, x1: float, y1: float, owner: Ints, ends: Floats, count: int) -> int:
    """Append the monotone pieces of edge e, which ends at (x1, y1), to ``count`` others; returns their new number.

    The tangent turns from phi - h to phi + h, phi the chord's angle and h = 2 atan(b), so the cuts are at the multiples
    of a quarter turn in between; the chord from the start to the point of tangent angle a points to the mean of both
    tangent angles and is L sin((a - a0) / 2) / sin(h) long.
    """
    x0, y0 = table[e, X0], table[e, Y0]
    xa, ya = x0, y0
    if _turns_past_an_axis(table, e):
        quarter = 0.5 * math.pi
        b = table[e, BULGE]
        half = 2.0 * math.atan(b)
        start = math.atan2(table[e, SX], table[e, CX]) - half
        turn = 2.0 * half
        scale = table[e, LENGTH] / math.sin(half)
        sign = 1.0 if b > 0.0 else -1.0
        k = math.floor(start / quarter) + 1.0 if b > 0.0 else math.ceil(start / quarter) - 1.0
        while sign * (k * quarter - start) < abs(turn):
            delta = k * quarter - start
            reach = scale * math.sin(0.5 * delta)
            xb = x0 + reach * math.cos(start + 0.5 * delta)
            yb = y0 + reach * math.sin(start + 0.5 * delta)
            owner[count] = e
            ends[count, 0], ends[count, 1], ends[count, 2], ends[count, 3] = xa, ya, xb, yb
            count += 1
            xa, ya = xb, yb
            k += sign
    owner[count] = e
    ends[count, 0], ends[count, 1], ends[count, 2], ends[count, 3] = xa, ya, x1, y1
    return count + 1


@nb.njit(cache=True, error_model="numpy")
def monotone_pieces(table: Floats, x: Floats, y: Floats, nxt: Ints, owner: Ints, ends: Floats) -> int:
    """Cut every edge where it runs level or upright; returns the number of pieces.

    ``owner`` (5 n,) and ``ends`` (5 n, 4) are filled with each piece's edge and its xa, ya, xb, yb.
    """
    count = 0
    for e in range(table.shape[0]):
        count = cut_edge(table, e, x[nxt[e]], y[nxt[e]], owner, ends, count)
    return count


@nb.njit(cache=True, inline="always", error_model="numpy")
def _root(a: float, h: float, c: float, falls: bool) -> float:
    """The root X of a X^2 + 2 h X + c at which a X + h is >= 0, or <= 0 where the piece ``falls``.

    It is taken in whichever form adds numbers of one sign, so that a = 0 is no special case.
    """
    root = math.sqrt(max(h * h - a * c, 0.0))
    if falls:
        root = -root
    if root * h >= 0.0:
        across = root + h
        return -c / across if across != 0.0 else 0.0
    return (root - h) / a


@nb.njit(cache=True, inline="always", error_model="numpy")
def x_at(table: Floats, e: int, ends: Floats, k: int, py: float) -> float:
    """Where piece k of edge e meets the height py (clamped to the piece's own box).

    f = A X^2 + 2 B X + C in X = x - x0, and A X + B has the sign of the piece's rise because grad f points right of
    travel.
    """
    xa: float = ends[k, 0]
    ya: float = ends[k, 1]
    xb: float = ends[k, 2]
    yb: float = ends[k, 3]
    # At its ends the piece's own numbers: on a nearly level piece the quadratic could land anywhere between them.
    if py <= min(ya, yb):
        return xa if ya <= yb else xb
    if py >= max(ya, yb):
        return xb if ya <= yb else xa
    low, high = (xa, xb) if xa < xb else (xb, xa)
    b = table[e, BULGE]
    if b == 0.0:
        return min(max(xa + (py - ya) * (xb - xa) / (yb - ya), low), high)
    length = table[e, LENGTH]
    rise = py - table[e, Y0]
    a = 2.0 * b
    h = table[e, FLAT] * table[e, SX] - b * length * table[e, CX]
    c = rise * (a * rise - 2.0 * (b * length * table[e, SX] + table[e, FLAT] * table[e, CX]))
    return float(min(max(_root(a, h, c, yb < ya) + table[e, X0], low), high))


@nb.njit(cache=True, inline="always", error_model="numpy")
def y_at(table: Floats, e: int, ends: Floats, k: int, px: float) -> float:
    """Where piece k of edge e meets the column px (clamped to the piece's own box); as :func:`x_at`, mirrored."""
    xa: float = ends[k, 0]
    ya: float = ends[k, 1]
    xb: float = ends[k, 2]
    yb: float = ends[k, 3]
    if px <= min(xa, xb):
        return ya if xa <= xb else yb
    if px >= max(xa, xb):
        return yb if xa <= xb else ya
    low, high = (ya, yb) if ya < yb else (yb, ya)
    b = table[e, BULGE]
    if b == 0.0:
        return min(max(ya + (px - xa) * (yb - ya) / (xb - xa), low), high)
    length = table[e, LENGTH]
    rise = px - table[e, X0]
    a = -2.0 * b
    h = table[e, FLAT] * table[e, CX] + b * length * table[e, SX]
    c = rise * (a * rise - 2.0 * (table[e, FLAT] * table[e, SX] - b * length * table[e, CX]))
    return float(min(max(_root(a, h, c, xb < xa) + table[e, Y0], low), high))


@nb.njit(cache=True, inline="always", error_model="numpy")
def column_of(x: float) -> int:
    """The first column whose centre is at x or right of it."""
    return math.ceil(x - 0.5)


@nb.njit(cache=True, inline="always", error_model="numpy")
def level_range(ends: Floats, k: int, r0: int, r1: int) -> tuple[int, int, int]:
    """The rows [low, high) of [r0, r1) whose centres piece k crosses, half-open upwards; its turn: +1 going down."""
    ya, yb = ends[k, 1], ends[k, 3]
    bottom, top = (ya, yb) if ya < yb else (yb, ya)
    return max(column_of(bottom), r0), min(column_of(top), r1), 1 if yb < ya else -1
