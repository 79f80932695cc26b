"""Closed curves that have a name: circle, rectangle, rounded rectangle, slot, regular polygon. No CAD kernel here.

Each is a value with its sizes in the loop's unit, angles in radians counter-clockwise from +x, and ``loop()``,
the exact curve.
"""

from __future__ import annotations

from cmath import exp as cexp
from cmath import phase
from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, hypot, pi, sin, sqrt, tan

import numpy as np

from d4cad.edges import chords, distances, points_along
from d4cad.errors import GeometryError
from d4cad.joining import joined
from d4cad.loop import Circle, Loop, Point, fitted_circle

__all__ = ["TOLERANCE", "Circle", "Feature", "Rectangle", "RegularPolygon", "RoundedRectangle", "Slot", "feature"]

TOLERANCE = 1e-6
"""Default distance, in the loop's unit, within which a loop is the curve that it is called."""

QUARTER = tan(pi / 8)
"""Bulge of a quarter of a circle."""

SLACK = 1e-9
"""Radians by which an angle at the end of its range may be beyond it: rounding must not turn a shape by 90 degrees."""


@dataclass(frozen=True, slots=True)
class Rectangle:
    """``center`` (x, y); ``width`` along ``angle``, which is in (-pi/4, pi/4]; ``height`` across it."""

    center: Point
    width: float
    height: float
    angle: float = 0.0

    def loop(self, clockwise: bool = False) -> Loop:
        """The four sides, from the corner that is lower left before turning."""
        w, h = self.width / 2, self.height / 2
        return _placed(((-w, -h), (w, -h), (w, h), (-w, h)), (0.0,) * 4, self.center, self.angle, clockwise)


@dataclass(frozen=True, slots=True)
class RoundedRectangle:
    """A rectangle whose four corners are quarter circles of ``radius``, less than half of either side."""

    center: Point
    width: float
    height: float
    radius: float
    angle: float = 0.0

    def loop(self, clockwise: bool = False) -> Loop:
        """Four sides and four arcs, beginning with the lower side before turning."""
        w, h, r = self.width / 2, self.height / 2, self.radius
        points = ((r - w, -h), (w - r, -h), (w, r - h), (w, h - r), (w - r, h), (r - w, h), (-w, h - r), (-w, r - h))
        return _placed(points, (0.0, QUARTER) * 4, self.center, self.angle, clockwise)


@dataclass(frozen=True, slots=True)
class Slot:
    """Two parallel sides and two semicircles. ``length``: overall, along ``angle``, which is in (-pi/2, pi/2]."""

    center: Point
    length: float
    width: float
    angle: float = 0.0

    def loop(self, clockwise: bool = False) -> Loop:
        """Two sides and two arcs, beginning with the lower side before turning."""
        reach, r = (self.length - self.width) / 2, self.width / 2
        points = ((-reach, -r), (reach, -r), (reach, r), (-reach, r))
        return _placed(points, (0.0, 1.0, 0.0, 1.0), self.center, self.angle, clockwise)


@dataclass(frozen=True, slots=True)
class RegularPolygon:
    """``sides`` equal sides, 3 or 5 and more; corners at ``radius``, one of them at ``angle`` in [0, 2 pi / sides)."""

    center: Point
    radius: float
    sides: int
    angle: float = 0.0

    def loop(self, clockwise: bool = False) -> Loop:
        """The sides, from the corner at ``angle``."""
        turns = [2 * pi * k / self.sides for k in range(self.sides)]
        points = tuple((self.radius * cos(turn), self.radius * sin(turn)) for turn in turns)
        return _placed(points, (0.0,) * self.sides, self.center, self.angle, clockwise)


Feature = Circle | Rectangle | RoundedRectangle | Slot | RegularPolygon


def feature(loop: Loop, tolerance: float = TOLERANCE) -> Feature | None:
    """What the loop is, to within ``tolerance`` (a length in its unit) both ways; None if it has no name.

    Orientation, first vertex and vertices in the middle of a side or an arc do not matter. The values are means over
    the loop's vertices, not rounded. Raises GeometryError for a tolerance that is not positive.

    >>> feature(Loop(((0, 0), (6, 0), (6, 2), (0, 2)), (0, 1, 0, 1)))
    Slot(center=(3.0, 1.0), length=8.0, width=2.0, angle=0.0)
    """
    if not tolerance > 0:
        raise GeometryError(f"the tolerance of a feature must be positive, got {tolerance}")
    circle = fitted_circle(loop, tolerance)
    if circle is not None:
        return circle
    found = _candidate(joined(loop.oriented(), tolerance / 4))
    return found if found is not None and _agree(loop, found.loop(), tolerance) else None


def _candidate(loop: Loop) -> Feature | None:
    """What a counter-clockwise loop without needless vertices could be, by its edges' kinds alone."""
    z = loop.edges.z0
    n = z.size
    arcs = [b != 0 for b in loop.bulges]
    if not any(arcs):
        return _rectangle(z.tolist()) if n == 4 else _regular(z.tolist())
    if arcs[0]:  # a line first
        z, arcs = np.roll(z, -1), [*arcs[1:], arcs[0]]
    if arcs == [False, True] * 2:
        return _slot(z.tolist())
    return _rounded(z.tolist()) if arcs == [False, True] * 4 else None


def _rectangle(z: Sequence[complex]) -> Rectangle:
    u, v = (z[1] - z[0] + z[2] - z[3]) / 2, (z[2] - z[1] + z[3] - z[0]) / 2
    return Rectangle(_mean(z), *_upright(abs(u), abs(v), _direction(u, v)))


def _rounded(z: Sequence[complex]) -> RoundedRectangle | None:
    """Sides begin at z[0], z[2], z[4], z[6]; their middles tell the sizes, the arcs' chords the radius."""
    middle = [(z[k] + z[k + 1]) / 2 for k in range(0, 8, 2)]
    across, up = middle[1] - middle[3], middle[2] - middle[0]
    radius = sum(abs(z[(k + 2) % 8] - z[k + 1]) for k in range(0, 8, 2)) / (4 * sqrt(2))
    width, height, angle = _upright(abs(across), abs(up), _direction(across, up))
    if 2 * radius >= min(width, height):
        return None
    return RoundedRectangle(_mean(z), width, height, radius, angle)


def _slot(z: Sequence[complex]) -> Slot:
    axis = (z[1] + z[2]) / 2 - (z[3] + z[0]) / 2
    width = (abs(z[2] - z[1]) + abs(z[0] - z[3])) / 2
    return Slot(_mean(z), abs(axis) + width, width, _within(phase(axis), pi))


def _regular(z: Sequence[complex]) -> RegularPolygon:
    n, (x, y) = len(z), _mean(z)
    spokes = [corner - complex(x, y) for corner in z]
    first = sum(spoke * cexp(-2j * pi * k / n) for k, spoke in enumerate(spokes))
    angle = phase(first) % (2 * pi / n)
    radius = sum(hypot(spoke.real, spoke.imag) for spoke in spokes) / n
    return RegularPolygon((x, y), radius, n, 0.0 if 2 * pi / n - angle < SLACK else angle)


def _mean(z: Sequence[complex]) -> Point:
    middle = sum(z) / len(z)
    return middle.real, middle.imag


def _direction(across: complex, up: complex) -> float:
    """The angle of a rectangle with these sides: the longer side tells it better."""
    return phase(across * abs(across) + up / 1j * abs(up))


def _upright(width: float, height: float, angle: float) -> tuple[float, float, float]:
    """The same rectangle with its angle in (-pi/4, pi/4]."""
    angle = _within(angle, pi)
    if -pi / 4 + SLACK < angle <= pi / 4 + SLACK:
        return width, height, angle
    return height, width, _within(angle - pi / 2, pi)


def _within(angle: float, period: float) -> float:
    """The angle in (-period / 2, period / 2]."""
    angle = angle % period
    return angle - period if angle > period / 2 + SLACK else angle


def _placed(points: Sequence[Point], bulges: tuple[float, ...], center: Point, angle: float, clockwise: bool) -> Loop:
    """A counter-clockwise loop about the origin, turned and then moved."""
    c, s = cos(angle), sin(angle)
    loop = Loop(tuple((center[0] + c * x - s * y, center[1] + s * x + c * y) for x, y in points), bulges)
    return loop.reversed() if clockwise else loop


def _agree(a: Loop, b: Loop, tolerance: float) -> bool:
    """Whether eight points on every edge of either loop lie within ``tolerance`` of the other."""
    for these, others in ((a.edges, b.edges), (b.edges, a.edges)):
        if not np.all(chords(others) > 0):
            return False
        z = points_along(these.take((slice(None), None)), np.arange(8) / 8).ravel()
        if np.any(distances(others.take((None, slice(None))), z[:, None]).min(axis=1) > tolerance):
            return False
    return True
