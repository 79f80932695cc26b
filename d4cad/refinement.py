"""A chain of lines and arcs moved to the least squared distance from points, and rid of vertices that noise had made
necessary.

Distances are linearised as everywhere in d4cad: by the envelope theorem the distance of a point changes with the foot
on the edge at a fixed parameter t of the Moebius curve (:mod:`d4cad.edges`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from d4cad.deviation import along, one_way
from d4cad.edges import Bools, Complexes, Edges, Floats, chords, circle_distances, lengths, sagittas

Indices = NDArray[np.int64]

STEPS = 8
DAMPING = 1e-2
"""Added to the normal equations, in which every point counts 1: what the points do not determine stays."""

FREELY = 1.2
"""A vertex is worth trying without if one line or circle comes within so many tolerances of all points around it."""

WORSE = 0.02
"""Squared error, as a share of the tolerance squared, that a line in place of an arc may cost on the average."""


class Samples(NamedTuple):
    """Points of a curve in order.

    z: (n,), x + iy. weight: (n,) 1 for points to fit, 0 for those that must only be near. closed: whether the first
    follows the last.
    """

    z: Complexes
    weight: Floats
    closed: bool


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """Edges through points of a curve.

    points: the vertices, (k,) of a closed chain and (k + 1,) of an open one, x + iy. bulges: (k,). at: (k + 1,) indices
    of the samples where edges begin and the last ends, counted on past the first lap.
    """

    points: Complexes
    bulges: Floats
    at: Indices

    @property
    def edges(self) -> Edges:
        """The k edges."""
        k = self.bulges.size
        return Edges(self.points[:k], self.points[(np.arange(k) + 1) % self.points.size], self.bulges)

    @property
    def closed(self) -> bool:
        """Whether the last edge ends where the first begins."""
        return self.points.size == self.bulges.size


def refined(chain: Chain, samples: Samples, fixed: Bools, tolerance: float) -> Chain:
    """The chain with as few vertices, and as near to the samples, as moves of its vertices and bulges allow.

    fixed: (n,) samples at which a vertex stays as it is; the ends of an open chain stay as well. The result is within
    ``tolerance`` of the samples and the lines between them if ``chain`` is, and the reverse.
    """
    moved = _without_needless(_settled(chain, samples, fixed, tolerance), samples, fixed, tolerance)
    moved = _settled(moved, samples, fixed, tolerance)
    return moved if _is_near(moved, samples, np.arange(moved.bulges.size), tolerance) else chain


def _settled(chain: Chain, samples: Samples, fixed: Bools, tolerance: float) -> Chain:
    """All vertices and bulges moved, if the chain stays near the samples."""
    every = np.arange(chain.bulges.size)
    moved = _moved(chain, samples, every, _free(chain, samples, fixed))
    return moved if _is_near(moved, samples, every, tolerance) else chain


def _free(chain: Chain, samples: Samples, fixed: Bools) -> Bools:
    """Which vertices may move."""
    free = ~fixed[chain.at[: chain.points.size] % samples.z.size]
    if not chain.closed:
        free[[0, -1]] = False
    return free


def _without_needless(chain: Chain, samples: Samples, fixed: Bools, tolerance: float) -> Chain:
    """Vertices left out one by one, and arcs made lines, where the edges around can be moved so that it does not
    matter."""
    i = 0
    while i < chain.points.size:
        found = None
        if chain.bulges.size > (2 if chain.closed else 1) and _free(chain, samples, fixed)[i]:
            found = _without(chain, i, samples, fixed, tolerance)
        chain, i = (chain, i + 1) if found is None else (found, max(i - 2, 0))
    for i in np.flatnonzero(chain.bulges).tolist():
        chain = _with_line(chain, i, samples, fixed, tolerance)
    return chain


def _without(chain: Chain, i: int, samples: Samples, fixed: Bools, tolerance: float) -> Chain | None:
    """The chain without vertex i, or None if no edge can replace the two beside it."""
    k = chain.bulges.size
    before = (i - 1) % k
    first, last = int(chain.at[before]), int(chain.at[i + 1])
    if last <= first:  # the window runs over the start of a closed chain
        last += samples.z.size
    q = samples.z[np.arange(first, last + 1) % samples.z.size]
    if not _one_curve(q, FREELY * tolerance):
        return None
    points = np.delete(chain.points, i)
    at = np.delete(chain.at, i)
    if i == 0:
        at[-1] = at[0] + samples.z.size
    edge = before - 1 if i == 0 else before  # the index of the merged edge, its start being vertex ``before``
    z0, z1 = points[edge], points[(edge + 1) % points.size]
    inner = q[1:-1][(np.abs(q[1:-1] - z0) > tolerance) & (np.abs(q[1:-1] - z1) > tolerance)]
    u = (z1 - inner) / (inner - z0)
    half = float(np.angle(np.sum(u / np.abs(u)))) if inner.size else 0.0
    for bulge in (0.0, np.tan(half / 2)):
        bulges = np.delete(chain.bulges, i)
        bulges[edge] = bulge
        if np.count_nonzero(bulges) == 0 and chain.closed and bulges.size == 2:
            continue
        found = _near(Chain(points, bulges, at), edge, samples, fixed, tolerance)
        if found is not None:
            return found
    return None


def _with_line(chain: Chain, i: int, samples: Samples, fixed: Bools, tolerance: float) -> Chain:
    """The chain with a line for arc i, where the points hardly tell the two apart."""
    if abs(float(sagittas(chain.edges)[i])) > 2 * tolerance:
        return chain
    bulges = chain.bulges.copy()
    bulges[i] = 0.0
    if chain.closed and bulges.size == 2 and not np.any(bulges):
        return chain
    found = _near(replace(chain, bulges=bulges), i, samples, fixed, tolerance)
    if found is None:
        return chain
    around = _around(i, chain)
    count = max(sum(chain.at[j + 1] - chain.at[j] for j in around.tolist()), 1)
    loss = _error(found, samples, around) - _error(chain, samples, around)
    return found if loss <= WORSE * tolerance**2 * count else chain


def _near(chain: Chain, edge: int, samples: Samples, fixed: Bools, tolerance: float) -> Chain | None:
    """The chain moved at and around an edge until it is near the samples there, or None."""
    around = _around(edge, chain)
    ends = np.zeros(chain.points.size, dtype=np.bool_)
    ends[[edge, (edge + 1) % chain.points.size]] = True
    moved = _moved(chain, samples, around, ends & _free(chain, samples, fixed))
    return moved if _is_near(moved, samples, around, tolerance) else None


def _around(edge: int, chain: Chain) -> Indices:
    """An edge and its neighbours."""
    k = chain.bulges.size
    near = np.arange(edge - 1, edge + 2)
    return np.unique(near % k if chain.closed else near[(near >= 0) & (near < k)])


def _one_curve(q: Complexes, tolerance: float) -> bool:
    """Whether a line or a circle comes within the tolerance of all points: least squares, the circle's by Kasa
    (1976)."""
    p = q - q.mean()
    if np.abs(p).max() <= tolerance:
        return True
    spread = np.linalg.eigh(np.cov(np.stack([p.real, p.imag])))[1]
    normal = complex(*spread[:, 0])
    if np.abs((p * np.conj(normal)).real).max() <= tolerance:
        return True
    rows = np.stack([p.real, p.imag, np.ones(p.size)], axis=1)
    (x, y, c), *_ = np.linalg.lstsq(rows, np.abs(p) ** 2, rcond=None)
    radius = np.sqrt(max(c + (x * x + y * y) / 4, 0.0))
    return bool(np.abs(np.abs(p - complex(x, y) / 2) - radius).max() <= tolerance)


def _owned(chain: Chain, samples: Samples, edges: Indices) -> tuple[Complexes, Floats, Indices]:
    """The samples of some edges, both ends included, their weights, and the edge of each."""
    ranges = [np.arange(chain.at[j], chain.at[j + 1] + 1) for j in edges.tolist()]
    index = np.concatenate(ranges) % samples.z.size
    return samples.z[index], samples.weight[index], np.repeat(edges, [r.size for r in ranges])


def _error(chain: Chain, samples: Samples, edges: Indices) -> float:
    q, weight, owner = _owned(chain, samples, edges)
    return float(np.sum(weight * circle_distances(chain.edges.take(owner), q) ** 2))


def _moved(chain: Chain, samples: Samples, edges: Indices, free: Bools) -> Chain:
    """Levenberg-Marquardt steps on the free vertices and on the bulges of the arcs among ``edges``."""
    q, weight, owner = _owned(chain, samples, edges)
    q, owner = q[weight > 0], owner[weight > 0]
    arcs = edges[chain.bulges[edges] != 0]
    layout = _Layout(np.full(chain.points.size, -1), np.full(chain.bulges.size, -1))
    layout.vertex[free] = 2 * np.arange(np.count_nonzero(free))
    layout.bulge[arcs] = 2 * np.count_nonzero(free) + np.arange(arcs.size)
    if q.size == 0 or not (np.any(free) or arcs.size):
        return chain
    damping, value = DAMPING, float(np.sum(circle_distances(chain.edges.take(owner), q) ** 2))
    for _ in range(STEPS):
        step = _step(chain, q, owner, layout, damping)
        tried = _stepped(chain, step, layout)
        found = float(np.sum(circle_distances(tried.edges.take(owner), q) ** 2))
        if not found < value:
            damping *= 30
            continue
        small = value - found <= 1e-6 * value
        chain, value = tried, found
        if small:
            break
    return _reassigned(chain, samples, free)


class _Layout(NamedTuple):
    """Columns of the normal equations: of each vertex its x, with y behind it, and of each bulge; -1 where it is
    kept."""

    vertex: Indices
    bulge: Indices

    @property
    def size(self) -> int:
        return 2 * int(np.count_nonzero(self.vertex >= 0)) + int(np.count_nonzero(self.bulge >= 0))


def _step(chain: Chain, q: Complexes, owner: Indices, layout: _Layout, damping: float) -> Floats:
    from scipy.sparse import coo_array, identity
    from scipy.sparse.linalg import spsolve

    every = chain.edges
    e = every.take(owner)
    d = circle_distances(e, q)
    angle = 2 * np.arctan(e.b)
    gradient = 2 * np.sin(angle) * (q - (e.z0 + e.z1) / 2) - 1j * (e.z1 - e.z0) * np.cos(angle)
    normal = gradient / np.maximum(np.abs(gradient), np.finfo(float).tiny)
    foot = q - d * normal
    near, far = np.abs(foot - e.z0), np.abs(foot - e.z1)
    t = near / np.maximum(near + far, np.finfo(float).tiny)
    below = (1 - t) + e.w * t
    by_start, by_end = (1 - t) / below, e.w * t / below
    chord = chords(e)
    by_sagitta = (-2j / (1 + e.b**2) * e.w) * (e.z1 - e.z0) * t * (1 - t) / below**2 * (2 / np.maximum(chord, 1e-300))
    start, end = layout.vertex[owner], layout.vertex[(owner + 1) % chain.points.size]
    parts = [(start, by_start), (start + 1, 1j * by_start), (end, by_end), (end + 1, 1j * by_end)]
    parts = [(np.where(column >= (k % 2), column, -1), value) for k, (column, value) in enumerate(parts)]
    parts.append((layout.bulge[owner], by_sagitta))
    column = np.concatenate([c for c, _ in parts])
    row = np.tile(np.arange(q.size), len(parts))
    value = np.concatenate([-(v * np.conj(normal)).real for _, v in parts])
    keep = column >= 0
    jacobian = coo_array((value[keep], (row[keep], column[keep])), shape=(q.size, layout.size)).tocsc()
    matrix = (jacobian.T @ jacobian + damping * identity(layout.size)).tocsc()
    return np.asarray(-spsolve(matrix, jacobian.T @ d)).reshape(-1)


def _stepped(chain: Chain, step: Floats, layout: _Layout) -> Chain:
    points, bulges = chain.points.copy(), chain.bulges.copy()
    free = layout.vertex >= 0
    points[free] += step[layout.vertex[free]] + 1j * step[layout.vertex[free] + 1]
    bent = layout.bulge >= 0
    bulges[bent] += step[layout.bulge[bent]] * 2 / np.maximum(chords(chain.edges)[bent], 1e-300)
    return Chain(points, bulges, chain.at)


def _reassigned(chain: Chain, samples: Samples, free: Bools) -> Chain:
    """The chain with the samples nearest to its vertices as the places where edges begin."""
    at, n = chain.at.copy(), samples.z.size
    for i in np.flatnonzero(free).tolist():
        low = at[i - 1] if i else at[-2] - n
        index = np.arange(low + 1, at[i + 1])
        if index.size:
            at[i] = index[np.argmin(np.abs(samples.z[index % n] - chain.points[i]))]
        if i == 0:
            at[-1] = at[0] + n
    return Chain(chain.points, chain.bulges, at)


def _is_near(chain: Chain, samples: Samples, edges: Indices, tolerance: float) -> bool:
    """Whether some edges and their samples, with the lines between them, are within the tolerance of each other."""
    part = chain.edges.take(edges)
    if not np.all(np.isfinite(part.b)) or np.any(lengths(part) <= 0):
        return False
    ranges = [np.arange(chain.at[j], chain.at[j + 1] + 1) for j in edges.tolist()]
    index = np.concatenate(ranges) % samples.z.size
    if one_way(samples.z[index], part) > tolerance:
        return False
    starts = np.concatenate([r[:-1] for r in ranges])
    sides = Edges(samples.z[starts % samples.z.size], samples.z[(starts + 1) % samples.z.size], np.zeros(starts.size))
    return one_way(along(part), sides) <= tolerance and bool(np.all(np.abs(part.b) < 50))
