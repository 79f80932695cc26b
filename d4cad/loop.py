"""One closed curve of lines and circular arcs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np

from d4cad.edges import (
    Bools,
    Edges,
    Floats,
    boxes,
    chords,
    cross,
    lengths,
    points_along,
    sagittas,
    sector_areas,
    windings,
)
from d4cad.errors import GeometryError

Point = tuple[float, float]

ROUNDING = 1e-9
"""Lengths below this share of a loop's extent are rounding, not geometry."""


@dataclass(frozen=True, slots=True)
class Circle:
    """``center`` (x, y) and ``radius`` in the unit of the sketch it came from."""

    center: Point
    radius: float

    def loop(self, clockwise: bool = False) -> Loop:
        """The circle as two equal semicircle edges that start at its right."""
        (x, y), r = self.center, self.radius
        bulge = -1.0 if clockwise else 1.0
        return Loop(((x + r, y), (x - r, y)), (bulge, bulge))


@dataclass(frozen=True, slots=True)
class Loop:
    """A closed curve of n >= 2 bulge edges, y up.

    ``points``: the n vertices. ``bulges``: edge i runs from points[i] to points[(i + 1) % n] and its bulge is
    tan(sweep / 4): 0 a line, > 0 counter-clockwise, 1 a semicircle, above 1 a major arc.
    Raises GeometryError when there are fewer than two edges or the two lengths differ.

    >>> Circle((0.0, 0.0), 2.0).loop().area
    12.566370614359172
    """

    points: tuple[Point, ...]
    bulges: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.points) != len(self.bulges):
            raise GeometryError(f"a loop needs one bulge per vertex, got {len(self.points)} and {len(self.bulges)}")
        if len(self.points) < 2:
            raise GeometryError(f"a loop needs at least 2 edges, got {len(self.points)}")

    @classmethod
    def from_arrays(cls, points: Floats, bulges: Floats) -> Loop:
        """A loop from vertices (n, 2) and bulges (n,)."""
        return cls(tuple((float(x), float(y)) for x, y in points), tuple(float(b) for b in bulges))

    @classmethod
    def polyline(cls, points: Sequence[Point]) -> Loop:
        """A closed polygon through ``points``."""
        return cls(tuple(points), (0.0,) * len(points))

    @property
    def edges(self) -> Edges:
        """The n edges as complex arrays."""
        z = np.array(self.points, dtype=np.float64).view(np.complex128).ravel()
        return Edges(z, np.roll(z, -1), np.array(self.bulges, dtype=np.float64))

    @property
    def area(self) -> float:
        """Signed area, > 0 counter-clockwise: the polygon of the chords plus the circular segments."""
        e = self.edges
        origin = e.z0[0]  # relative to a vertex: a small loop far from the origin keeps its digits
        return float(np.sum(cross(e.z0 - origin, e.z1 - origin)) / 2 + np.sum(sector_areas(e)))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Exact xmin, ymin, xmax, ymax, arcs included."""
        box = boxes(self.edges)
        low, high = box[:, :2].min(axis=0), box[:, 2:].max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    @property
    def extent(self) -> float:
        """The longer side of the bounding box."""
        xmin, ymin, xmax, ymax = self.bounds
        return max(xmax - xmin, ymax - ymin)

    @property
    def lengths(self) -> tuple[float, ...]:
        """Arc length of each edge."""
        return tuple(float(v) for v in lengths(self.edges))

    @property
    def length(self) -> float:
        """Arc length all around."""
        return float(np.sum(lengths(self.edges)))

    @property
    def circle(self) -> Circle | None:
        """The circle that the loop goes around exactly once, to within rounding, or None."""
        return fitted_circle(self, ROUNDING * self.extent) if all(self.bulges) else None

    def reversed(self) -> Loop:
        """The same curve travelled the other way, from the same first vertex."""
        points = (self.points[0], *self.points[:0:-1])
        return Loop(points, tuple(0.0 - b for b in self.bulges[::-1]))

    def oriented(self, clockwise: bool = False) -> Loop:
        """The loop itself, or reversed, so that its interior lies to the left (to the right if ``clockwise``)."""
        return self.reversed() if (self.area < 0) != clockwise else self

    def scaled(self, factor: float) -> Loop:
        """All coordinates times ``factor`` > 0; bulges are pure numbers and stay."""
        return Loop(tuple((x * factor, y * factor) for x, y in self.points), self.bulges)

    def translated(self, dx: float, dy: float) -> Loop:
        """The loop moved by (dx, dy)."""
        return Loop(tuple((x + dx, y + dy) for x, y in self.points), self.bulges)

    def contains(self, points: Floats) -> Bools:
        """Whether points (k, 2) lie inside: exact, arcs included, whatever the loop's orientation."""
        z = np.ascontiguousarray(points, dtype=np.float64).view(np.complex128).ravel()
        return np.asarray(windings(self.edges, z) != 0)

    def polygon(self, tolerance: float) -> Floats:
        """Vertices (m, 2) of a polygon whose corners lie on the loop and whose sides are within ``tolerance`` of it."""
        return np.concatenate([trace[:-1] for trace in self.traces(tolerance)])

    def traces(self, tolerance: float) -> list[Floats]:
        """Each edge as points (m, 2) on it, ends included, no chord between them further than ``tolerance`` from it.

        A chord over the angle a of a circle of radius R is R (1 - cos(a / 2)) = 2 R sin(a / 4)^2 from it; none spans
        more than 60 degrees, so that a circle stays a polygon for any tolerance.
        """
        if not tolerance > 0:
            raise GeometryError(f"the tolerance of a polygon must be positive, got {tolerance}")
        e = self.edges
        curvature = 4 * np.abs(e.b) / ((1 + e.b**2) * np.maximum(chords(e), np.finfo(float).tiny))
        step = np.minimum(4 * np.arcsin(np.sqrt(np.minimum(tolerance * curvature / 2, 1.0))), np.pi / 3)
        sweep = 4 * np.arctan(np.abs(e.b))
        count = np.ceil(np.divide(sweep, step, out=np.ones_like(sweep), where=step > 0)).clip(1).astype(int)
        traces = []
        for i, n in enumerate(count.tolist()):
            z = points_along(e.take(slice(i, i + 1)), np.arange(n + 1) / n)
            z[0], z[-1] = e.z0[i], e.z1[i]
            traces.append(np.stack([z.real, z.imag], axis=1))
        return traces


def checked(loop: Loop, name: str) -> Loop:
    """The loop without zero-length edges, ready to bound a region.

    Raises GeometryError naming the loop where a number is not finite, fewer than two edges have a length, an
    edge closes on itself, or the area is zero.
    """
    for i, ((x, y), b) in enumerate(zip(loop.points, loop.bulges, strict=True)):
        if not (isfinite(x) and isfinite(y) and isfinite(b)):
            raise GeometryError(f"{name} is not finite at vertex {i}: ({x:g}, {y:g}) with bulge {b:g}")
    short = ROUNDING * loop.extent
    loop = without_short(loop, short, name)
    if abs(loop.area) <= short * loop.extent:
        x, y = loop.points[0]
        raise GeometryError(f"{name} encloses no area at ({x:g}, {y:g})")
    return loop


def without_short(loop: Loop, short: float, name: str = "a loop") -> Loop:
    """The loop without edges of chord <= ``short``; raises GeometryError if fewer than two remain."""
    e = loop.edges
    chord = chords(e)
    if np.all(chord > short):
        return loop
    turning = (chord <= short) & (chord * np.abs(e.b) > 2 * short)
    if np.any(turning):
        x, y = loop.points[int(np.argmax(turning))]
        raise GeometryError(f"{name} has a full turn in one edge at ({x:g}, {y:g}), split it in two")
    keep = np.flatnonzero(chord > short)
    if keep.size < 2:
        x, y = loop.points[0]
        raise GeometryError(f"{name} has {keep.size} edges of any length at ({x:g}, {y:g}), a loop needs 2")
    return Loop(tuple(loop.points[i] for i in keep), tuple(loop.bulges[i] for i in keep))


def fitted_circle(loop: Loop, tolerance: float) -> Circle | None:
    """The circle within ``tolerance`` of the whole loop, gone around exactly once, or None.

    Edges flatter than ``tolerance`` may be lines, or bent the other way. Algebraic least squares (Kasa 1976) through
    points on every edge, then all of them are checked.
    """
    e = loop.edges
    sweep = 4 * float(np.sum(np.arctan(e.b)))
    if abs(abs(sweep) - 2 * np.pi) > 1.0:
        return None
    if np.any((e.b * sweep < 0) & (np.abs(sagittas(e)) > tolerance)):
        return None
    z = points_along(e.take((slice(None), None)), np.arange(8) / 8).ravel()
    middle = z.mean()
    p = z - middle
    rows = np.stack([p.real, p.imag, np.ones(p.size)], axis=1)
    (x, y, k), *_ = np.linalg.lstsq(rows, np.abs(p) ** 2, rcond=None)
    radius = float(np.sqrt(max(k + (x * x + y * y) / 4, 0.0)))
    center = middle + complex(x, y) / 2
    if np.max(np.abs(np.abs(z - center) - radius)) > 0.98 * tolerance or radius <= tolerance:
        return None
    return Circle((float(center.real), float(center.imag)), radius)
