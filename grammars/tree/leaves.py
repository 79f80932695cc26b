"""Leaf shapes, compiled: signed distance, its derivative, and where it is under a level on a row of pixels.

A leaf of size r sits at a node and points along the node's heading. With q the point in the node's frame, forward and
lateral, t = q_forward - offset r and w = |q_lateral|,

    d = |(w, t)| - r                    behind the widest place, t < 0
    d = |(w + e, t)| - (r + e)          ahead of it,   e = r (reach^2 - 1) / 2

so that behind it is a disc and ahead of it the common part of two discs of radius r + e, which meet in a tip at
t = reach r. The two join with one tangent. Beyond the tip d is the distance to the larger disc, not to the tip, as in
the paper. reach = 1 makes e = 0 and the leaf a disc.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb

from d4cad.program import Floats


@dataclass(frozen=True, slots=True)
class Leaf:
    """The shape of leaves: the tip lies ``reach`` times the size ahead of the widest place, and that ``offset`` times
    the size ahead of the node."""

    reach: float
    offset: float

    @property
    def excess(self) -> float:
        """e / r: by how much the radius of the tip's two arcs exceeds the size, as a share of it."""
        return (self.reach**2 - 1) / 2


POINTED = Leaf(reach=1.6, offset=1.0)
"""The paper's leaf, which touches its node with its base."""
DISC = Leaf(reach=1.0, offset=0.0)
"""A disc about its node."""
LEAVES = {"leaf": POINTED, "disc": DISC}


@nb.njit(cache=True, inline="always", error_model="numpy")
def distance(dx: float, dy: float, cos: float, sin: float, r: float, excess: float, offset: float) -> float:
    """Signed distance, negative inside, at (dx, dy) from the node; cos, sin: of the heading."""
    t = cos * dx + sin * dy - offset * r
    w = abs(cos * dy - sin * dx)
    e = excess * r if t >= 0.0 else 0.0
    w += e
    return math.sqrt(w * w + t * t) - (r + e)


@nb.njit(cache=True, error_model="numpy")
def slope(
    dx: float, dy: float, cos: float, sin: float, r: float, excess: float, offset: float, out: Floats, grow: float
) -> None:
    """``grow`` times the derivative of the distance by the leaf's x, y, heading and size into ``out`` (4,).

    On the axis of the leaf, where both arcs are equally near, the lateral part is taken to be 0; likewise all but the
    size's at the centre of the disc.
    """
    forward = cos * dx + sin * dy
    lateral = cos * dy - sin * dx
    t = forward - offset * r
    e = excess if t >= 0.0 else 0.0
    w = abs(lateral) + e * r
    size = math.sqrt(w * w + t * t)
    along = t / size if size > 0.0 else 0.0
    across = w / size if size > 0.0 else 0.0
    turn = math.copysign(across, lateral) if lateral != 0.0 else 0.0
    out[0] = -grow * (along * cos - turn * sin)
    out[1] = -grow * (along * sin + turn * cos)
    out[2] = grow * (along * lateral - turn * forward)
    out[3] = grow * (e * across - offset * along - 1.0 - e)


@nb.njit(cache=True, inline="always", error_model="numpy")
def _disc_run(x: float, y: float, radius: float) -> tuple[float, float]:
    """Where the row at height 0 lies in a disc about (x, y); empty (1, 0) where it does not."""
    under = radius * radius - y * y
    if radius < 0.0 or under < 0.0:
        return 1.0, 0.0
    half = math.sqrt(under)
    return x - half, x + half


@nb.njit(cache=True, error_model="numpy")
def run(
    x: float, y: float, cos: float, sin: float, r: float, excess: float, offset: float, level: float
) -> tuple[float, float]:
    """Where a leaf's distance is at most ``level`` on the row at height 0: one stretch of x, empty (1, 0) for none.

    x, y: the node as seen from the row. That part of the plane is convex: half of a disc behind the widest place, half
    of the common part of two discs ahead of it, with the same width where they meet.
    """
    if r + level < 0.0:
        return 1.0, 0.0
    wx, wy = x + offset * r * cos, y + offset * r * sin  # the widest place
    low, high = _disc_run(wx, wy, r + level)
    e = excess * r
    if e == 0.0:
        return low, high
    # t = cos (px - wx) + sin (0 - wy) < 0 behind.
    lens_low, lens_high = _disc_run(wx - e * sin, wy + e * cos, r + e + level)
    other_low, other_high = _disc_run(wx + e * sin, wy - e * cos, r + e + level)
    lens_low, lens_high = max(lens_low, other_low), min(lens_high, other_high)
    if abs(cos) < 1e-12:
        if -sin * wy < 0.0:
            return low, high
        return lens_low, lens_high
    edge = wx + sin * wy / cos  # where t = 0 on the row
    if cos > 0.0:
        high, lens_low = min(high, edge), max(lens_low, edge)
    else:
        low, lens_high = max(low, edge), min(lens_high, edge)
    if low > high:
        return lens_low, lens_high
    if lens_low > lens_high:
        return low, high
    return min(low, lens_low), max(high, lens_high)
