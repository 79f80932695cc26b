"""The fewest lines and circular arcs within a tolerance of a chain of points.

Candidate ends are the points that polyline simplification keeps well within the tolerance. For every pair of them the
line or arc through both that stays within the tolerance is found exactly (:mod:`d4cad.runs`); dynamic programming
takes the chain of fewest edges, and among those the one of least squared error. Its vertices are points of the chain:
:mod:`d4cad.refinement` then moves them, and leaves out those that noise had made necessary.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from d4cad.deviation import deviation
from d4cad.edges import Bools, Complexes, Floats
from d4cad.errors import GeometryError
from d4cad.loop import ROUNDING, Loop, fitted_circle
from d4cad.refinement import Chain, Samples, refined

Indices = NDArray[np.int64]

SHARES = (0.98, 0.9, 0.7)
"""Shares of the tolerance that edges may use at the points that are looked at: the next where it is exceeded
between."""

ENDS = 260
"""So many candidate ends are enough to look for more by a finer simplification."""

LOOKED_AT = 48
"""Points of a run that are looked at first; all of them where that proves too few."""

PATIENCE = 8


def segment(points: Floats, tolerance: float, *, corners: Sequence[int] = ()) -> Loop:
    """The closed polygon through ``points`` (n, 2) as few lines and arcs.

    The result stays within ``tolerance``, a length in the unit of the points, of the polygon and the reverse.
    ``corners``: indices of points at which an edge must end; a vertex of the result lies within the tolerance of each.
    A polygon within the tolerance of one circle becomes two semicircles. Raises GeometryError for a tolerance that is
    not positive, points that are not finite, or fewer than three different ones.
    """
    z = _plane(points, tolerance)
    z, kept = _distinct(z, closed=True)
    if z.size < 3:
        raise GeometryError(f"a closed curve needs at least 3 different points, got {z.size}")
    polygon = Loop.from_arrays(np.stack([z.real, z.imag], axis=1), np.zeros(z.size))
    must = _marked(corners, kept, len(points), z.size)
    circle = None if np.any(must) else _circle(polygon, tolerance)
    if circle is not None:
        return circle
    for share in SHARES:
        chain = _chain(z, share * tolerance, must, closed=True)
        loop = Loop.from_arrays(np.stack([chain.points.real, chain.points.imag], axis=1), chain.bulges)
        if deviation(loop, polygon) <= tolerance:
            return loop
    return polygon


def segment_chain(points: Floats, tolerance: float, *, corners: Sequence[int] = ()) -> tuple[Floats, Floats]:
    """The open polyline through ``points`` (n, 2) as few lines and arcs: vertices (k + 1, 2) and bulges (k,).

    The first and last points stay where they are; otherwise as :func:`segment`. One vertex and no bulge if all points
    are one.
    """
    z = _plane(points, tolerance)
    z, kept = _distinct(z, closed=False)
    if z.size < 2:
        return np.stack([z.real, z.imag], axis=1), np.zeros(0)
    chain = _chain(z, SHARES[0] * tolerance, _marked(corners, kept, len(points), z.size), closed=False)
    return np.stack([chain.points.real, chain.points.imag], axis=1), chain.bulges


def _plane(points: Floats, tolerance: float) -> Complexes:
    if not (tolerance > 0 and np.isfinite(tolerance)):
        raise GeometryError(f"the tolerance of a simplification must be positive, got {tolerance}")
    array = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1:] != (2,) or len(array) == 0:
        raise GeometryError(f"expected points of shape (n, 2), got {array.shape}")
    finite = np.isfinite(array).all(axis=1)
    if not np.all(finite):
        raise GeometryError(f"point {int(np.argmin(finite))} is not finite")
    return np.ascontiguousarray(array).view(np.complex128).ravel()


def _distinct(z: Complexes, closed: bool) -> tuple[Complexes, Indices]:
    """The points without repetitions, and for each given point the index of the one that stands for it."""
    extent = max(float(np.ptp(z.real)), float(np.ptp(z.imag)))
    new = np.ones(z.size, dtype=np.bool_)
    new[1:] = np.abs(np.diff(z)) > ROUNDING * extent
    kept = np.cumsum(new) - 1
    z = z[new]
    if closed and z.size > 1 and abs(z[-1] - z[0]) <= ROUNDING * extent:
        z = z[:-1]
        kept %= z.size
    return z, kept


def _marked(corners: Sequence[int], kept: Indices, given: int, n: int) -> Bools:
    must = np.zeros(n, dtype=np.bool_)
    for i in corners:
        if not 0 <= i < given:
            raise GeometryError(f"expected corners from 0 to {given - 1}, got {i}")
        must[kept[i]] = True
    return must


def _circle(polygon: Loop, tolerance: float) -> Loop | None:
    """Two semicircles if one circle is within the tolerance of the whole polygon."""
    circle = fitted_circle(_bowed(polygon), tolerance)
    if circle is None:
        return None
    loop = circle.loop(clockwise=polygon.area < 0)
    return loop if deviation(loop, polygon) <= tolerance else None


def _bowed(polygon: Loop) -> Loop:
    """The polygon with arcs that turn by as much as it does at their ends, so that its vertices say what its radius
    is."""
    e = polygon.edges
    heading = np.angle(e.z1 - e.z0)
    turn = np.remainder(heading - np.roll(heading, 1) + np.pi, 2 * np.pi) - np.pi
    return Loop(polygon.points, tuple(np.tan(np.clip((turn + np.roll(turn, -1)) / 8, -0.4, 0.4)).tolist()))


class _Found(NamedTuple):
    """Samples at which edges end, counted on past the first lap, their half sweeps, and what the chain costs."""

    at: Indices
    half: Floats
    cost: float


def _chain(z: Complexes, tolerance: float, must: Bools, closed: bool) -> Chain:
    samples, place = _samples(z, tolerance, closed)
    forced = np.zeros(samples.z.size, dtype=np.bool_)
    forced[place[must]] = True
    ends = _ends(samples, place, forced, tolerance)
    found = _cheapest(samples, ends, forced, tolerance)
    finer = _cheapest(samples, _ends_near(found, samples, place), forced, tolerance)
    found = min(found, finer, key=lambda f: f.cost)
    n = samples.z.size
    first = Chain(
        samples.z[found.at % n] if not closed else samples.z[found.at[:-1] % n], np.tan(found.half / 2), found.at
    )
    return refined(first, samples, forced, tolerance)


def _samples(z: Complexes, tolerance: float, closed: bool) -> tuple[Samples, Indices]:
    """The vertices, which count in fits, and points on long sides between them, which must only stay near; and where
    the vertices are among them."""
    following = np.roll(z, -1) if closed else z[1:]
    length = np.abs(following - z[: following.size])
    pieces = np.ceil(length / max(length.sum() / 512, 4 * tolerance)).clip(1, 64).astype(np.int64)
    pieces[length > 4 * tolerance] = np.maximum(pieces[length > 4 * tolerance], 2)
    begin = np.cumsum(pieces) - pieces
    side = np.repeat(np.arange(pieces.size), pieces)
    share = (np.arange(side.size) - begin[side]) / pieces[side]
    points = z[side] * (1 - share) + following[side] * share
    weight = (share == 0).astype(np.float64)
    if closed:
        return Samples(points, weight, closed), begin
    points, weight = np.append(points, z[-1]), np.append(weight, 1.0)
    return Samples(points, weight, closed), np.append(begin, points.size - 1)


def _ends(samples: Samples, place: Indices, forced: Bools, tolerance: float) -> Indices:
    """Indices of samples that may become vertices: few, but with them a chain within the tolerance."""
    from d4cad.runs import essential

    z = samples.z[place]
    x, y = np.ascontiguousarray(z.real), np.ascontiguousarray(z.imag)
    for share in (1 / 16, 1 / 8, 1 / 4, 1 / 2, 3 / 4):
        keep = forced[place].copy()
        if samples.closed:
            far = int(np.argmax(np.abs(z - z[0])))
            essential(x, y, 0, far, share * tolerance, keep)
            essential(x, y, far, z.size, share * tolerance, keep)
        else:
            essential(x, y, 0, z.size - 1, share * tolerance, keep)
        if np.count_nonzero(keep) <= ENDS:
            break
    return np.asarray(place[keep])


def _ends_near(found: _Found, samples: Samples, place: Indices) -> Indices:
    """The ends found and the vertices next to each, so that the best of them can be taken."""
    reach = max(ENDS // (2 * found.at.size), 2)
    at = np.searchsorted(place, found.at % samples.z.size)
    index = (at[:, None] + np.arange(-reach, reach + 1)[None, :]).ravel()
    index = index % place.size if samples.closed else index[(index >= 0) & (index < place.size)]
    return np.asarray(place[np.unique(index)])


def _cheapest(samples: Samples, ends: Indices, forced: Bools, tolerance: float) -> _Found:
    """The cheapest chain whose edges are within the tolerance at every sample; of infinite cost if there is none."""
    from d4cad.runs import cheapest, cheapest_ring, fitted, reaches

    n, m = samples.z.size, ends.size
    x, y = np.ascontiguousarray(samples.z.real), np.ascontiguousarray(samples.z.imag)
    looked_at = LOOKED_AT
    while True:
        cost = reaches(x, y, samples.weight, ends, forced[ends], samples.closed, looked_at, tolerance, PATIENCE)
        chain, price = cheapest_ring(cost) if samples.closed else cheapest(cost, 0, m - 1, np.inf)
        at = np.asarray(ends[chain % m] + n * (chain // m), dtype=np.int64)
        found = [fitted(x, y, samples.weight, a, b, 1, tolerance) for a, b in pairwise(at.tolist())]
        if looked_at >= n or all(error < np.inf for _, error in found):
            return _Found(at, np.array([half for half, _ in found]), price)
        looked_at *= 8
