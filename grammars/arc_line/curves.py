"""Plane geometry of bulge edges, compiled: the scalar functions that repair and rewriting share.

An edge is (x0, y0, x1, y1, b), b = tan(sweep / 4) > 0 counter-clockwise, 0 a line.
"""

from __future__ import annotations

import math

import numba as nb


@nb.njit(cache=True, inline="always")
def apex(x0, y0, x1, y1, b):
    """The point at half the sweep: b half-chords to the right of the chord's middle."""
    return 0.5 * (x0 + x1) + 0.5 * b * (y1 - y0), 0.5 * (y0 + y1) - 0.5 * b * (x1 - x0)


@nb.njit(cache=True, inline="always")
def sub_bulge(b, share):
    """Bulge of the part of an arc that has ``share`` of its sweep."""
    return math.tan(share * math.atan(b))


@nb.njit(cache=True, inline="always")
def point_along(x0, y0, x1, y1, b, share):
    """The point at ``share`` of the length of an edge.

    The chord to it has the length of the edge's times sin(share h) / sin(h), h half the sweep, and is turned from it by
    (share - 1) h.
    """
    half = 2.0 * math.atan(b)
    turn = (share - 1.0) * half
    scale = share if abs(half) < 1e-9 else math.sin(share * half) / math.sin(half)
    c, s = scale * math.cos(turn), scale * math.sin(turn)
    return x0 + c * (x1 - x0) - s * (y1 - y0), y0 + s * (x1 - x0) + c * (y1 - y0)


@nb.njit(cache=True, inline="always")
def turn_at(x, y, b, p, i, j):
    """The angle in (-pi, pi] by which the boundary turns left at vertex i, between the edges from p and to j."""
    ux, uy, vx, vy = x[i] - x[p], y[i] - y[p], x[j] - x[i], y[j] - y[i]
    angle = math.atan2(ux * vy - uy * vx, ux * vx + uy * vy) - 2.0 * (math.atan(b[p]) + math.atan(b[i]))
    return math.atan2(math.sin(angle), math.cos(angle))


@nb.njit(cache=True, inline="always")
def bulge_through(x0, y0, x1, y1, x2, y2):
    """Bulge of the arc from point 0 through point 1 to point 2.

    The turn between the chords 0-1 and 1-2 is half the sweep (inscribed angle); the bulge is the tangent of its half.
    """
    ax, ay, bx, by = x1 - x0, y1 - y0, x2 - x1, y2 - y1
    cross = ax * by - ay * bx
    dot = ax * bx + ay * by
    size = math.hypot(cross, dot)
    if size + dot <= 1e-12 * size:
        return 0.0
    return cross / (size + dot)


@nb.njit(cache=True, inline="always")
def arc_length(x0, y0, x1, y1, b):
    """Length of an edge."""
    chord = math.hypot(x1 - x0, y1 - y0)
    if abs(b) < 1e-6:
        return chord
    half = 2.0 * math.atan(abs(b))
    return chord * half / math.sin(half)


@nb.njit(cache=True, inline="always")
def segment_area(x0, y0, x1, y1, b):
    """Signed area between an edge's arc and its chord, > 0 where the arc is counter-clockwise.

    r^2 (theta - sin theta) / 2 with r = c (1 + b^2) / (4 b) and theta = 4 atan(b); b c^2 / 3 as b -> 0.
    """
    chord2 = (x1 - x0) ** 2 + (y1 - y0) ** 2
    if abs(b) < 1e-3:
        return chord2 * b * (1.0 + 0.2 * b * b) / 3.0
    theta = 4.0 * math.atan(b)
    r = (1.0 + b * b) / (4.0 * b)
    return 0.5 * chord2 * r * r * (theta - math.sin(theta))


@nb.njit(cache=True)
def loop_area(x, y, b, nxt, start):
    """Signed area of the loop that starts at vertex ``start``, > 0 counter-clockwise."""
    area = 0.0
    i = start
    ox, oy = x[start], y[start]
    while True:
        j = nxt[i]
        area += 0.5 * ((x[i] - ox) * (y[j] - oy) - (x[j] - ox) * (y[i] - oy))
        area += segment_area(x[i], y[i], x[j], y[j], b[i])
        i = j
        if i == start:
            return area


@nb.njit(cache=True)
def winding(x, y, b, nxt, px, py):
    """Winding number of all loops about a point.

    Half-open crossings of the chords by the ray to the left, plus or minus one inside an arc's circular segment.
    """
    turns = 0
    for i in range(x.shape[0]):
        j = nxt[i]
        if j == i:
            continue
        x0, y0, x1, y1 = x[i], y[i], x[j], y[j]
        dx, dy = x1 - x0, y1 - y0
        right = (px - x0) * dy - (py - y0) * dx  # chord times v, > 0 right of travel
        if (y0 <= py) != (y1 <= py):
            # The ray to the left meets the chord iff the point is right of it: right of travel if the chord rises.
            if dy > 0.0 and right >= 0.0:
                turns -= 1
            elif dy < 0.0 and right < 0.0:
                turns += 1
        if b[i] != 0.0 and (right >= 0.0) == (b[i] > 0.0):
            along = (px - x0) * dx + (py - y0) * dy
            reach = (px - x0) ** 2 + (py - y0) ** 2
            f = 2.0 * b[i] * (reach - along) + (1.0 - b[i] * b[i]) * right
            if f * b[i] < 0.0:
                turns += 1 if b[i] > 0.0 else -1
    return turns
