"""Widths of material, and of the space between, measured on the exact outline.

A span is a straight segment inside the material from one place of the outline to another that face each other. Three
kinds together find every narrow place: rays from points along the outline, straight inwards, to where they come out
(between walls that are parallel to within FACING); centre lines of arcs with arcs and lines; and reflex corners (those
where material has more than 180 degrees) with what is nearest to them. So a sharp convex corner is no thin wall, unless
it is sharper than FACING. The space between is the same with all loops turned around.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from d4cad.cutting import Ints, nodes
from d4cad.edges import Bools, Complexes, Edges, Floats, chords, lengths, nearest_on_circle, points_along, within_sweep
from d4cad.loop import ROUNDING, Loop

FACING = np.radians(20.0)
"""Two sides face each other if they are parallel to within this."""

STEP, TURN = 1 / 60, np.radians(6.0)
"""Rays start at most this share of the size apart along an edge, and this angle along an arc."""

REFINED = 16
"""So many of the shortest rays are made locally shortest."""


class Spans(NamedTuple):
    """Segments from ``p`` to ``q`` of some ``length``, (n,) each, the shortest first."""

    p: Complexes
    q: Complexes
    length: Floats

    def take(self, index: Any) -> Spans:
        """The spans at a numpy ``index``."""
        return Spans(self.p[index], self.q[index], self.length[index])


def spans(loops: Sequence[Loop], limit: float = 0.0) -> Spans:
    """The shortest spans across what lies to the left of disjoint ``loops``, in their unit: some of them, and all kinds
    of those that are no longer than ``limit``. None where nothing faces anything."""
    e, tangents = edges_and_corners(loops)
    slack = ROUNDING * float(np.abs(e.z0 - e.z0.mean()).max())
    rays = _inward_rays(e, slack)
    longest = max(limit, float(rays.length.min(initial=np.inf))) + slack
    tried = [rays, _corner_pairs(e, tangents, longest, slack), _centre_pairs(e, longest, slack)]
    p, q, length = (np.concatenate([some[k] for some in tried]) for k in range(3))
    order = np.argsort(np.round(length / (10 * slack)), kind="stable")
    found = Spans(p[order], q[order], length[order])
    return found.take(np.flatnonzero(found.length <= longest))


def places(found: Spans, distance: float) -> Spans:
    """The shortest span of every narrow place: spans whose middles are within ``distance``, also by way of others,
    are at one place."""
    label, _ = nodes((found.p + found.q) / 2, distance)
    return found.take(np.unique(label))  # labels are the first, shortest, of each


def edges_and_corners(loops: Sequence[Loop]) -> tuple[Edges, Complexes]:
    """All edges, and the unit tangents (2, n) at the start of each: of the edge before it and of its own."""
    parts = [loop.edges for loop in loops]
    e = Edges(*(np.concatenate([part[k] for part in parts]) for k in range(3)))
    heading, half = (e.z1 - e.z0) / chords(e), 2 * np.arctan(e.b)
    start, end = heading * np.exp(-1j * half), heading * np.exp(1j * half)
    before: list[int] = []
    for part in parts:
        n = len(before)
        before += [n + part.b.size - 1, *range(n, n + part.b.size - 1)]
    return e, np.stack([end[before], start])


def outward(e: Edges, q: Complexes) -> Complexes:
    """Unit normals to the right of edges at points q on them."""
    half = 2 * np.arctan(e.b)
    n = 2 * np.sin(half) * (q - (e.z0 + e.z1) / 2) - 1j * (e.z1 - e.z0) * np.cos(half)
    return np.asarray(n / np.maximum(np.abs(n), np.finfo(float).tiny))


def first_hits(e: Edges, p: Complexes, u: Complexes, slack: float) -> tuple[Floats, Ints]:
    """How far rays from p (k,) in the unit directions u (k,) run before they meet an edge (n,), and which edge that is;
    infinite where they meet none. Meetings nearer than ``slack`` are the start itself.

    Along a ray q = p + s u the edge's circle Im((z1 - q) conj(q - z0) w) = 0 is a quadratic in s.
    """
    far, edge = np.full(p.size, np.inf), np.zeros(p.size, dtype=np.int64)
    for k in range(0, p.size, 512):
        part = slice(k, k + 512)
        s = _meet(e, p[part, None], u[part, None], slack)
        edge[part] = s.argmin(axis=1)
        far[part] = s.min(axis=1)
    return far, edge


def _meet(e: Edges, p: Complexes, u: Complexes, slack: float) -> Floats:
    w = e.w
    start, end = p - e.z0, e.z1 - p
    c0, c2 = (w * end * np.conj(start)).imag, -w.imag
    c1 = (w * (end * np.conj(u) - u * np.conj(start))).imag
    root = np.sqrt(np.maximum(c1 * c1 - 4 * c2 * c0, 0.0))
    big = -(c1 + np.where(c1 < 0, -root, root)) / 2
    best = np.full(c0.shape, np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = (np.broadcast_to(big / c2, c0.shape), c0 / big)
    for s in roots:
        good = np.isfinite(s) & (s > slack) & (c1 * c1 >= 4 * c2 * c0)
        q = p + np.where(good, s, 0.0) * u
        best = np.where(good & on(e, q, slack), np.minimum(best, s), best)
    return best


def on(e: Edges, q: Complexes, slack: float) -> Bools:
    """Whether points q on the circles of edges are on the edges, ends included."""
    return np.asarray(within_sweep(e, q) | (np.minimum(np.abs(q - e.z0), np.abs(q - e.z1)) <= slack))


def nearest(e: Edges, p: Complexes) -> Complexes:
    """The point of each edge nearest to p."""
    foot, _ = nearest_on_circle(e, p)
    end = np.where(np.abs(p - e.z0) <= np.abs(p - e.z1), e.z0, e.z1)
    return np.asarray(np.where(within_sweep(e, foot), foot, end))


def _inward_rays(e: Edges, slack: float) -> Spans:
    """Rays inwards that come out of a side facing theirs; the shortest ones moved to where they are shortest."""
    extent = float(np.abs(e.z0 - e.z0.mean()).max())
    sweep = 4 * np.abs(np.arctan(e.b))
    count = np.ceil(np.maximum(lengths(e) / (STEP * extent), sweep / TURN)).clip(6, 40).astype(np.int64)
    edge = np.repeat(np.arange(count.size), count + 2)
    place = np.arange(edge.size) - np.repeat(np.cumsum(count + 2) - count - 2, count + 2)
    share = np.clip((place - 0.5) / count[edge], 1e-4, 1 - 1e-4)
    p, q, length = _rays(e, edge, share, slack)
    # of equally short ones the middle one, so that a place is shown in the middle of a straight wall
    order = np.lexsort((np.abs(share - 0.5), np.round(length / (10 * slack))))
    order = order[np.isfinite(length[order])]
    p, q, length, edge, share = p[order], q[order], length[order], edge[order], share[order]
    some = slice(0, REFINED)
    near, width = edge[some], 1 / count[edge[some]]
    at = share[some]
    for _ in range(6):
        tried = np.clip(at[:, None] + np.linspace(-1, 1, 5) * width[:, None], 1e-4, 1 - 1e-4)
        _, _, reach = _rays(e, np.repeat(near, 5), tried.ravel(), slack)
        reach = reach.reshape(tried.shape)
        best = np.where(reach[:, 2] <= reach.min(axis=1) + slack, 2, reach.argmin(axis=1))
        at, width = tried[np.arange(at.size), best], width / 2
    fine = _rays(e, near, at, slack)
    return Spans(*(np.concatenate([a[np.isfinite(fine.length)], b]) for a, b in zip(fine, (p, q, length), strict=True)))


def _rays(e: Edges, edge: Ints, share: Floats, slack: float) -> Spans:
    own = e.take(edge)
    p = points_along(own, share)
    u = -outward(own, p)
    length, hit = first_hits(e, p, u, slack)
    q = p + np.where(np.isfinite(length), length, 0.0) * u
    faces = np.isfinite(length) & ((outward(e.take(hit), q) * np.conj(u)).real >= np.cos(FACING))
    flat = (e.b[edge] == 0) & (e.b[hit] == 0)  # at an angle to a line its narrow end may be nearer
    near = nearest(e.take(hit), p)
    towards = np.conj(near - p) / np.maximum(np.abs(near - p), np.finfo(float).tiny)
    flat &= ((u * towards).real >= np.cos(FACING)) & ((outward(e.take(hit), near) * towards).real >= np.cos(FACING))
    q = np.where(flat, near, q)
    return Spans(p, q, np.where(faces, np.abs(q - p), np.inf))


def _corner_pairs(e: Edges, tangents: Complexes, longest: float, slack: float) -> Spans:
    """From reflex corners to the foot on every edge, and to other reflex corners, where both ends are nearest."""
    come, go = tangents
    reflex = np.flatnonzero(np.angle(go / come) < -1e-6)
    v, come, go = e.z0[reflex], come[reflex], go[reflex]
    everything = e.take((None, slice(None)))
    foot, _ = nearest_on_circle(everything, v[:, None])
    a, c = np.nonzero(within_sweep(everything, foot))
    inner = np.minimum(np.abs(foot[a, c] - e.z0[c]), np.abs(foot[a, c] - e.z1[c])) > slack
    a, c = a[inner], c[inner]
    p, q = v[a], foot[a, c]
    u = (q - p) / np.maximum(np.abs(q - p), np.finfo(float).tiny)
    good = (
        _between(slack, q - p, longest) & _leaves(u, come[a], go[a]) & ((outward(e.take(c), q) * np.conj(u)).real > 0)
    )
    i, j = np.triu_indices(v.size, 1)
    w = (v[j] - v[i]) / np.abs(v[j] - v[i])
    both = _between(slack, v[j] - v[i], longest) & _leaves(w, come[i], go[i]) & _leaves(-w, come[j], go[j])
    return _free(e, np.concatenate([p[good], v[i[both]]]), np.concatenate([q[good], v[j[both]]]), slack)


def _leaves(u: Complexes, come: Complexes, go: Complexes) -> Bools:
    """Whether both sides of a corner lead away from the direction u, so that the corner is nearest to what is there."""
    return np.asarray(((go * np.conj(u)).real <= 1e-9) & ((-come * np.conj(u)).real <= 1e-9))


def _centre_pairs(e: Edges, longest: float, slack: float) -> Spans:
    """Between arcs along the line through their centres, and between arcs and lines across the line."""
    i, j = np.triu_indices(e.b.size, 1)
    p, q = centre_lines(e, i, j)
    kind, pair = np.nonzero(_between(slack, q - p, longest))
    i, j, p, q = i[pair], j[pair], p[kind, pair], q[kind, pair]
    u = (q - p) / np.abs(q - p)
    faces = (outward(e.take(i), p) * np.conj(u)).real < 0
    faces &= (outward(e.take(j), q) * np.conj(u)).real > 0
    k = np.flatnonzero(faces & on(e.take(i), p, slack) & on(e.take(j), q, slack))
    return _free(e, p[k], q[k], slack)


def _between(low: float, step: Complexes, high: float) -> Bools:
    return np.asarray((np.abs(step) > low) & (np.abs(step) <= high))


def centre_lines(e: Edges, i: Ints, j: Ints) -> tuple[Complexes, Complexes]:
    """Points (4, k) on the circles of edges i and j where both have one normal; not a number for two lines."""
    arc = np.abs(e.b) > 1e-9
    sine = np.where(arc, np.sin(2 * np.arctan(e.b)), 1.0)
    heading = (e.z1 - e.z0) / chords(e)
    radius = np.where(arc, chords(e) / (2 * np.abs(sine)), 0.0)
    start = heading * np.exp(-2j * np.arctan(e.b))
    centre = np.where(arc, e.z0 + 1j * start * np.sign(e.b) * radius, e.z0)
    shift = np.where(arc[j], 0, ((centre[i] - e.z0[j]) * np.conj(heading[j])).real * heading[j])
    other = np.where(arc[i], 0, ((centre[j] - e.z0[i]) * np.conj(heading[i])).real * heading[i])
    from_, to = centre[i] + other, centre[j] + shift
    gap = np.abs(to - from_)
    u = np.where(gap > 0, (to - from_) / np.where(gap > 0, gap, 1.0), 1.0)
    none = ~(arc[i] | arc[j])
    p = np.stack([np.where(none, np.nan, from_ + s * radius[i] * u) for s in (1, 1, -1, -1)])
    q = np.stack([np.where(none, np.nan, to + s * radius[j] * u) for s in (1, -1, 1, -1)])
    return p, q


def _free(e: Edges, p: Complexes, q: Complexes, slack: float) -> Spans:
    """The segments from p, into the material, to q that meet no edge before q."""
    length = np.abs(q - p)
    far, _ = first_hits(e, p, (q - p) / np.maximum(length, np.finfo(float).tiny), slack)
    good = far >= length * (1 - 1e-6) - slack
    return Spans(p[good], q[good], length[good])
