"""Fewer edges, same curve: neighbours on one line or circle become one edge.

Every candidate is judged against the edges of the original loop, never against an already joined one, so errors
do not add up along a chain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from d4cad.edges import Edges, Floats, chords, nearest_on_circle, points_along, sagittas, within_sweep
from d4cad.errors import GeometryError
from d4cad.loop import ROUNDING, Loop, fitted_circle, without_short

SAMPLES = np.arange(9) / 8
"""Shares of an edge's length at which a candidate is compared with it. Between two circular curves the distance
has one maximum, which nine samples miss by 2% at most: hence MARGIN."""

MARGIN = 0.98


@dataclass(frozen=True, slots=True)
class _Run:
    """Consecutive original edges ``first`` .. ``last`` (counted on past n), and the one bulge that replaces them."""

    first: int
    last: int
    bulge: float


def joined(loop: Loop, tolerance: float) -> Loop:
    """The loop with as few edges as neighbours on one line or circle allow.

    ``tolerance``: a length in the loop's unit. The result stays within it of the original and the reverse. Zero-length
    edges are dropped; a loop within it of one circle becomes two equal semicircles; neighbours, also across
    the first vertex, become one line or one arc where that stays within it; an edge whose sagitta is less
    becomes a line. Corners are never moved: every vertex of the result is one of the original's, circles apart.
    Raises GeometryError for a tolerance that is not positive or a loop without two edges of any length.
    """
    if not (tolerance > 0 and np.isfinite(tolerance)):
        raise GeometryError(f"the tolerance of a simplification must be positive, got {tolerance}")
    loop = without_short(loop, ROUNDING * loop.extent)
    circle = fitted_circle(loop, tolerance)
    if circle is not None:
        return circle.loop(clockwise=loop.area < 0)
    n = len(loop.points)
    runs = _close(loop, _runs(loop, tolerance), tolerance)
    found = Loop(tuple(loop.points[r.first % n] for r in runs), tuple(r.bulge for r in runs))
    # only edges that were not joined: a joined one has spent its tolerance, and is a line already if it can be
    flat = (np.abs(sagittas(found.edges)) < tolerance) & np.array([r.first == r.last for r in runs])
    if len(runs) == 2 and np.all(flat | (np.array(found.bulges) == 0)):  # two lines would enclose nothing
        return found
    return Loop(found.points, tuple(0.0 if f else b for f, b in zip(flat, found.bulges, strict=True)))


def _runs(loop: Loop, tolerance: float) -> list[_Run]:
    """Greedy runs, starting at a vertex that no join removes where there is one."""
    e, n = loop.edges, len(loop.points)
    start = next((i for i in range(n) if _bulge(e, i - 1 + n, i + n, tolerance) is None), 0)
    runs: list[_Run] = []
    for i in range(start, start + n):
        run = runs[-1] if runs else None
        bulge = _bulge(e, run.first, i, tolerance) if run else None
        if run and bulge is not None:
            runs[-1] = _Run(run.first, i, bulge)
        else:
            runs.append(_Run(i, i, loop.bulges[i % n]))
    return runs


def _close(loop: Loop, runs: list[_Run], tolerance: float) -> list[_Run]:
    """Joins the last run with the first if they fit, and gives up a join that left fewer than two edges."""
    n = len(loop.points)
    if len(runs) < 2:
        return [_Run(i, i, b) for i, b in enumerate(loop.bulges)]
    if len(runs) > 2:
        bulge = _bulge(loop.edges, runs[-1].first, runs[0].last + n, tolerance)
        if bulge is not None:
            return [_Run(runs[-1].first, runs[0].last + n, bulge), *runs[1:-1]]
    return runs


def _bulge(e: Edges, first: int, last: int, tolerance: float) -> float | None:
    """The bulge of the one edge that replaces edges first .. last (modulo n), or None if none is near enough."""
    n = e.b.size
    part = e.take(np.arange(first, last + 1) % n)
    whole = Edges(part.z0[:1], part.z1[-1:], np.zeros(1))
    if last - first + 1 >= n or chords(whole)[0] <= tolerance:
        return None
    flat = bool(np.all(np.abs(sagittas(part)) < tolerance))
    if flat and np.all(_deviation(whole, part) <= MARGIN * tolerance):
        return 0.0
    if np.any(part.b == 0) or np.any(np.sign(part.b) != np.sign(part.b[0])):
        return None
    candidates = whole._replace(b=_candidates(whole, part))
    deviation = _deviation(candidates, part)
    best = int(np.argmin(deviation))
    return float(candidates.b[best]) if deviation[best] <= MARGIN * tolerance else None


def _candidates(whole: Edges, part: Edges) -> Floats:
    """Bulges worth trying: that of the summed sweep, and of the inscribed angles at the vertices and apexes.

    A point q of an arc sees its chord under arg((z1 - q) / (q - z0)) = sweep / 2.
    """
    q = np.concatenate([part.z1[:-1], points_along(part, np.full(1, 0.5))])
    half = np.angle((whole.z1 - q) / (q - whole.z0))
    total = 2 * float(np.sum(np.arctan(part.b)))
    tries = np.array([total, np.median(half), (half.min() + half.max()) / 2])
    tries = tries[(np.abs(tries) < np.pi) & (np.sign(tries) == np.sign(part.b[0]))]
    return np.tan((tries if tries.size else np.full(1, half[0])) / 2)


def _deviation(candidates: Edges, part: Edges) -> Floats:
    """Largest distance (k,) of the part from each candidate (k,); infinite where the part runs back or leaves it."""
    q = points_along(part.take((slice(None), None)), SAMPLES).ravel()
    z0, z1 = candidates.z0[:, None], candidates.z1[:, None]
    arcs = Edges(z0, z1, candidates.b[:, None])
    foot, d = nearest_on_circle(arcs, q[None, :])
    slack = 1e-7 * np.abs(z1 - z0)
    near, far = np.abs(foot - z0), np.abs(foot - z1)
    inside = within_sweep(arcs, foot) | (near <= slack) | (far <= slack)
    forward = np.diff(near / (near + far), axis=1) >= -1e-7
    good = np.all(inside, axis=1) & np.all(forward, axis=1)
    return np.where(good, np.abs(d).max(axis=1), np.inf)
