"""How far two closed curves are apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from d4cad.edges import Complexes, Edges, lengths, points_along
from d4cad.loop import Loop

POINTS = 2048
"""Points along a drawing at which distances are measured, besides at least MIN_POINTS on every edge."""

MIN_POINTS = 6


def deviation(a: Loop, b: Loop) -> float:
    """The Hausdorff distance of two loops: no point of either is further from the other.

    Measured from points on both to the exact edges of the other; see :func:`drawn_apart`.
    """
    return drawn_apart([a], [b])


def drawn_apart(a: Sequence[Loop], b: Sequence[Loop]) -> float:
    """The Hausdorff distance of the curves of two drawings, from points at most 1/2048 of their length apart."""
    first, second = gathered(a), gathered(b)
    return max(one_way(along(first), second), one_way(along(second), first))


def gathered(loops: Sequence[Loop]) -> Edges:
    """All edges of loops as one array."""
    parts = [loop.edges for loop in loops]
    return Edges(*(np.concatenate([part[k] for part in parts]) for k in range(3)))


def along(e: Edges) -> Complexes:
    """Points along edges, their starts among them."""
    length = lengths(e)
    count = np.ceil(POINTS * length / max(float(length.sum()), np.finfo(float).tiny)).clip(MIN_POINTS).astype(np.int64)
    edge = np.repeat(np.arange(count.size), count)
    place = np.arange(edge.size) - np.repeat(np.cumsum(count) - count, count)
    return points_along(e.take(edge), place / count[edge])


def one_way(q: Complexes, e: Edges) -> float:
    """The largest distance of points q from the nearest of the edges."""
    from d4cad.runs import farthest

    parts = (q.real, q.imag, e.z0.real, e.z0.imag, e.z1.real, e.z1.imag, e.b)
    worst, _ = farthest(*(np.ascontiguousarray(part, dtype=np.float64) for part in parts))
    return float(worst)
