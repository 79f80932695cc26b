"""Plane geometry of bulge edges, vectorised: points are complex numbers, y up, and edges are arrays of them.

An edge runs from ``z0`` to ``z1`` with bulge b = tan(sweep / 4), b > 0 counter-clockwise: the arc then bulges to
the right of travel. b = 0 is a line and needs no special case below, because an edge is the Moebius curve

    z(t) = (z0 (1 - t) + w z1 t) / ((1 - t) + w t),    w = (1 - ib)^2 / (1 + b^2),    t in [0, 1]

so that centres and radii, which go to infinity as b goes to 0, are never formed. The circle of an edge is the zero
set of F(q) = Im((z1 - q) conj(q - z0) w), the inscribed angle theorem; with s = sin(sweep / 2) and the signed
distance d of q from the circle (positive to the right of travel), F = d (d s + |z1 - z0|).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Complexes = NDArray[np.complex128]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Edges(NamedTuple):
    """Edges as arrays that broadcast against each other.

    ``z0``, ``z1``: start and end points, x + iy. ``b``: bulges.
    """

    z0: Complexes
    z1: Complexes
    b: Floats

    def take(self, index: Any) -> Edges:
        """The edges at a numpy ``index``."""
        return Edges(self.z0[index], self.z1[index], self.b[index])

    @property
    def w(self) -> Complexes:
        """The Moebius weight of each edge, of modulus 1; its argument is -sweep / 2."""
        return np.asarray((1 - 1j * self.b) ** 2 / (1 + self.b**2))


def cross(a: Complexes, b: Complexes) -> Floats:
    """x of a times y of b minus y of a times x of b: positive when b lies to the left of a."""
    return np.asarray((np.conj(a) * b).imag)


def chords(e: Edges) -> Floats:
    """Distance from start to end."""
    return np.abs(e.z1 - e.z0)


def sagittas(e: Edges) -> Floats:
    """Signed distance of the apex from the chord: bulge x chord / 2."""
    return e.b * chords(e) / 2


def lengths(e: Edges) -> Floats:
    """Arc lengths, radius x |sweep| = chord (1 + b^2) atan(b) / b."""
    b = np.where(np.abs(e.b) < 1e-8, 1e-8, e.b)  # the quotient is 1 + 2 b^2 / 3 there: equal to 1 in float64
    return np.asarray(chords(e) * (1 + b * b) * np.arctan(b) / b)


def points_at(e: Edges, t: Floats) -> Complexes:
    """Points z(t) of the Moebius curve; t broadcasts against the edges."""
    weight = e.w * t
    return np.asarray((e.z0 * (1 - t) + e.z1 * weight) / ((1 - t) + weight))


def points_along(e: Edges, fraction: Floats) -> Complexes:
    """Points at a ``fraction`` in [0, 1] of the arc length; it broadcasts against the edges.

    The chords from the two ends to the point at angle f x sweep are 2R sin(f sweep / 2) and
    2R sin((1 - f) sweep / 2), and t is the first over the sum of both.
    """
    half = 2 * np.arctan(np.maximum(np.abs(e.b), 1e-8))
    near, far = np.sin(fraction * half), np.sin((1 - fraction) * half)
    return points_at(e, near / (near + far))


def sector_areas(e: Edges) -> Floats:
    """Signed area between chord and arc, positive for b > 0.

    R^2 (sweep - sin sweep) / 2 = chord^2 ((1 + b^2)^2 atan(b) - b (1 - b^2)) / (8 b^2); its Taylor series
    in b near 0, where the closed form cancels.
    """
    flat = np.abs(e.b) < 0.05
    b = np.where(flat, 1.0, e.b)
    q = e.b * e.b
    series = e.b * (1 / 3 + q * (1 / 15 + q * (-1 / 105 + q * (1 / 315 - q / 693))))
    closed = ((1 + b * b) ** 2 * np.arctan(b) - b * (1 - b * b)) / (8 * b * b)
    return np.asarray(chords(e) ** 2 * np.where(flat, series, closed))


def boxes(e: Edges) -> Floats:
    """Exact bounding boxes (n, 4): xmin, ymin, xmax, ymax.

    With m the unit normal at the apex, the arc spans the normals within half its sweep of m. Where an axis
    direction u is among them the arc reaches mid . u + R (1 - cos(sweep / 2) m . u); the bracket is written as
    a sum of terms that do not cancel when R is huge.
    """
    low: list[Floats] = []
    high: list[Floats] = []
    flat = np.abs(e.b) < 1e-14  # sagitta below the rounding of the end points
    b = np.where(flat, 1.0, np.abs(e.b))
    c = chords(e)
    m = -1j * (e.z1 - e.z0) / np.where(c > 0, c, 1.0) * np.sign(e.b)
    cos_half = (1 - b * b) / (1 + b * b)
    radius = c * (1 + b * b) / (4 * b)
    for u in (1.0 + 0j, 1j):
        ends0, ends1 = (e.z0 * np.conj(u)).real, (e.z1 * np.conj(u)).real
        mid = (ends0 + ends1) / 2
        along, across = (m * np.conj(u)).real, (m * np.conj(u)).imag
        for sign, out in ((1.0, high), (-1.0, low)):
            cosine = sign * along
            versine = np.where(cosine > 0, across**2 / (1 + np.abs(cosine)), 1 - cosine)
            reach = sign * mid + radius * (2 * b * b / (1 + b * b) + cos_half * versine)
            best = np.maximum(sign * ends0, sign * ends1)
            inside = ~flat & (cosine >= cos_half)
            out.append(sign * np.where(inside, np.maximum(reach, best), best))
    return np.stack([low[0], low[1], high[0], high[1]], axis=-1)


def circle_distances(e: Edges, q: Complexes) -> Floats:
    """Signed distance of points q from the full circle (or line) of each edge, positive to the right of travel."""
    s = 2 * e.b / (1 + e.b**2)
    c = chords(e)
    value = ((e.z1 - q) * np.conj(q - e.z0) * e.w).imag
    root = np.sqrt(np.maximum(c * c + 4 * value * s, 0.0))
    below = c + root
    return np.asarray(2 * value / np.where(below > 0, below, 1.0))


def nearest_on_circle(e: Edges, q: Complexes) -> tuple[Complexes, Floats]:
    """Foot of each q on the circle of each edge, and the signed distance to it (positive to the right)."""
    d = circle_distances(e, q)
    angle = 2 * np.arctan(e.b)  # half the sweep
    gradient = 2 * np.sin(angle) * (q - (e.z0 + e.z1) / 2) - 1j * (e.z1 - e.z0) * np.cos(angle)
    size = np.abs(gradient)
    normal = np.where(size > 0, gradient / np.where(size > 0, size, 1.0), 1.0)
    return np.asarray(q - d * normal), d


def within_sweep(e: Edges, q: Complexes) -> Bools:
    """Whether points q on the circle of each edge lie on the edge itself, ends included."""
    return np.asarray(((q - e.z0) * np.conj((e.z1 - q) * e.w)).real >= 0)


def distances(e: Edges, q: Complexes) -> Floats:
    """Unsigned distance of points q from the edges."""
    foot, d = nearest_on_circle(e, q)
    ends = np.minimum(np.abs(q - e.z0), np.abs(q - e.z1))
    return np.asarray(np.where(within_sweep(e, foot), np.abs(d), ends))


def windings(e: Edges, q: Complexes) -> NDArray[np.int64]:
    """Winding numbers (k,) of the closed curve of edges (n,) around points q (k,) that are not on it."""
    return np.asarray(turns(e, q).sum(axis=1))


def turns(e: Edges, q: Complexes) -> NDArray[np.int64]:
    """What each edge (n,) of closed curves adds to their winding numbers around points q (k,): (k, n).

    Half-open crossings of the chord polygon by the ray towards +x, plus or minus one inside each circular
    segment. A point on a chord counts as shifted to +x and then to +y in both parts, so that they agree.
    """
    z0, z1, p = e.z0[None, :], e.z1[None, :], q[:, None]
    side = cross(z1 - z0, p - z0)
    up = (z0.imag <= p.imag) & (p.imag < z1.imag)
    down = (z1.imag <= p.imag) & (p.imag < z0.imag)
    count = (up & (side > 0)).astype(np.int64) - (down & (side < 0)).astype(np.int64)
    falling = (z1.imag < z0.imag) | ((z1.imag == z0.imag) & (z1.real > z0.real))
    left = (side > 0) | ((side == 0) & falling)
    d = circle_distances(Edges(z0, z1, e.b[None, :]), p)
    count += ((e.b > 0)[None, :] & ~left & (d < 0)).astype(np.int64)
    count -= ((e.b < 0)[None, :] & left & (d > 0)).astype(np.int64)
    return count


def meetings(a: Edges, c: Edges, touch: float) -> tuple[Bools, Complexes]:
    """Whether edges a[k] and c[k], which share no vertex, come within ``touch`` of each other; and where.

    Exact crossings, tangencies and ends on the other edge. Along a the circle of c is a quadratic in t with
    Bernstein coefficients f0, f1, f2, because a Moebius map takes circles to circles.
    """
    t, real = _roots(*_quadratic(a, c))
    met = np.zeros(a.b.shape, dtype=np.bool_)
    where = np.array(a.z0, copy=True)
    for k in range(t.shape[0]):
        q = points_at(a, t[k])
        met, where = _note(met, where, real[k] & (distances(c, q) <= touch), q)
    for end, other in ((a.z0, c), (a.z1, c), (c.z0, a), (c.z1, a)):
        met, where = _note(met, where, distances(other, end) <= touch, end)
    return met, where


def neighbour_meetings(a: Edges, c: Edges, touch: float) -> tuple[Bools, Complexes]:
    """As :func:`meetings` for a[k] that ends where c[k] begins: whether they meet anywhere else.

    The shared vertex is the root t = 1 of the quadratic; the other is f0 / (f0 - 2 f1).
    """
    f0, f1, _ = _quadratic(a, c)
    below = f0 - 2 * f1
    t = np.where(below != 0, f0 / np.where(below != 0, below, 1.0), 2.0)
    q = points_at(a, np.clip(t, 0.0, 1.0))
    apart = 1e3 * touch
    found = (t >= 0) & (t <= 1) & (np.abs(q - a.z1) > apart) & (distances(c, q) <= touch)
    # between the tangent sides of a cusp rounding leaves crossings, with less than ``touch`` in between
    found &= distances(c, points_at(a, (np.clip(t, 0.0, 1.0) + 1) / 2)) > touch
    met, where = _note(np.zeros(a.b.shape, dtype=np.bool_), np.array(a.z0, copy=True), found, q)
    closed = np.abs(a.z0 - c.z1) <= touch  # two edges that share both vertices
    for end, other in ((a.z0, c), (c.z1, a)):
        met, where = _note(met, where, ~closed & (distances(other, end) <= touch), end)
    return met & ~(closed & (np.abs(where - a.z0) <= apart)), where


def crossings(a: Edges, c: Edges) -> tuple[Complexes, Floats, Bools]:
    """Where edges a[k] meet the circles of c[k]: points (2, n), their t on a (2, n), and which exist (2, n).

    Both are the point nearest to the circle where the two pass each other or the crossing was lost to rounding.
    """
    t, real = _roots(*_quadratic(a, c))
    return points_at(a, t), t, real


def _quadratic(a: Edges, c: Edges) -> tuple[Floats, Floats, Floats]:
    """Bernstein coefficients of F_c(z_a(t)) |D|^2 = f0 (1-t)^2 + 2 f1 t (1-t) + f2 t^2."""
    v, w = c.w, a.w
    start, end = c.z1 - a.z0, w * (c.z1 - a.z1)
    start0, end0 = a.z0 - c.z0, w * (a.z1 - c.z0)
    f0 = (start * np.conj(start0) * v).imag
    f1 = ((start * np.conj(end0) + end * np.conj(start0)) * v).imag / 2
    f2 = (end * np.conj(end0) * v).imag
    return np.asarray(f0), np.asarray(f1), np.asarray(f2)


def _roots(f0: Floats, f1: Floats, f2: Floats) -> tuple[Floats, Bools]:
    """Roots (2, n) in [0, 1] of Bernstein quadratics, and which are real ones (2, n).

    Where the discriminant is negative both are the point of least value, so that a tangency lost to rounding is
    still looked at. Stable in both limits: t / (1 - t) solves f2 x^2 + 2 f1 x + f0 = 0.
    """
    root = np.sqrt(np.maximum(f1 * f1 - f0 * f2, 0.0))
    big = -(f1 + np.where(f1 < 0, -root, root))
    # x = big / f2 and x = f0 / big, as homogeneous pairs (t, 1 - t)
    top = np.stack([big, f0])
    bottom = np.stack([f2, big])
    total = top + bottom
    with_sign = (np.sign(top) * np.sign(bottom) >= 0) & (total != 0)
    return np.where(with_sign, top / np.where(total != 0, total, 1.0), 0.0), with_sign


def _note(met: Bools, where: Complexes, found: Bools, q: Complexes) -> tuple[Bools, Complexes]:
    return met | found, np.asarray(np.where(found & ~met, q, where))
