"""Edges that meet anywhere, cut at the nodes where they do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from d4cad.edges import Complexes, Edges, Floats, boxes, crossings, distances, points_at, sagittas
from d4cad.loop import ROUNDING, Loop

Ints = NDArray[np.int64]


class Pieces(NamedTuple):
    """Parts of edges between nodes, (n,) each.

    ``edge``: which they are part of. ``since``, ``until``: shares of its sweep. ``tail``, ``head``: nodes.
    ``fall``: of the winding number, from left to right.
    """

    edge: Ints
    since: Floats
    until: Floats
    tail: Ints
    head: Ints
    fall: Ints

    def take(self, index: Any) -> Pieces:
        """The pieces at a numpy ``index``."""
        return Pieces(*(column[index] for column in self))


class Network(NamedTuple):
    """What the steps below share: all ``edges`` (n,), for each the ``following`` one of its loop and the bulge of
    the given edge of which both are ``halves`` (0: of none), the length ``touch`` below which points are one, and the
    positions ``at`` of nodes."""

    edges: Edges
    following: Ints
    halves: Floats
    touch: float
    at: Complexes


def cut_edges(loops: Sequence[Loop]) -> tuple[Network, Pieces]:
    """All edges cut at all nodes."""
    e, following, halves = _minor_edges(loops)
    box = boxes(e)
    touch = ROUNDING * float((box[:, 2:].max(axis=0) - box[:, :2].min(axis=0)).max())
    edge, point = _hits(e, box, touch)
    node, at = nodes(np.concatenate([e.z0, point]), touch)
    n = e.b.size
    rows = np.concatenate([np.arange(n), np.arange(n), edge])
    names = np.concatenate([node[:n], node[following], node[n:]])
    share = np.concatenate([np.zeros(n), np.ones(n), shares(e.take(edge), point)])
    share[(names == node[rows]) & (share < 0.5)] = 0.0
    share[(names == node[following[rows]]) & (share > 0.5)] = 1.0
    order = np.lexsort((share, rows))
    rows, names, share = rows[order], names[order], share[order]
    k = np.flatnonzero((rows[1:] == rows[:-1]) & (names[1:] != names[:-1]))
    fall = np.ones(k.size, dtype=np.int64)
    pieces = Pieces(rows[k], share[k], share[k + 1], names[k], names[k + 1], fall)
    return Network(e, following, halves, touch, at), pieces


def _minor_edges(loops: Sequence[Loop]) -> tuple[Edges, Ints, Floats]:
    """All edges, those of more than half a turn as two, for each the following one of its loop, and for the first of
    such two the bulge of both. No edge then comes back near its start, and every chord tells its length."""
    parts = [loop.edges for loop in loops]
    e = Edges(*(np.concatenate([part[k] for part in parts]) for k in range(3)))
    wide = np.abs(e.b) > 1
    pair = np.repeat(np.arange(e.b.size), 1 + wide)
    first = np.flatnonzero(wide) + np.arange(np.count_nonzero(wide))
    halves = np.zeros(pair.size)
    halves[first] = e.b[wide]
    z0, b = e.z0[pair], e.b[pair]
    z0[first + 1] = points_at(e.take(wide), np.full(first.size, 0.5))
    b[first] = b[first + 1] = np.tan(np.arctan(e.b[wide]) / 2)
    sizes = np.array([part.b.size + np.count_nonzero(np.abs(part.b) > 1) for part in parts])
    begin = np.repeat(np.cumsum(sizes) - sizes, sizes)
    following = begin + (np.arange(pair.size) - begin + 1) % np.repeat(sizes, sizes)
    return Edges(z0, z0[following], b), following, halves


def _hits(e: Edges, box: Floats, touch: float) -> tuple[Ints, Complexes]:
    """Edges and points on them where they must be cut."""
    i, j = near_pairs(box, touch)
    a, c = e.take(i), e.take(j)
    ends = np.stack([a.z0, a.z1, c.z0, c.z1])
    on = np.stack([distances(c, a.z0), distances(c, a.z1), distances(a, c.z0), distances(a, c.z1)]) <= touch
    place, t, real = crossings(a, c)
    met = real & (distances(c, place) <= touch)
    near, far = np.abs(ends - a.z0), np.abs(ends - a.z1)
    t_ends = near / np.maximum(near + far, np.finfo(float).tiny)

    def along(first: Floats, second: Floats) -> Any:
        """Whether the edges stay together between two places on a."""
        return distances(c, points_at(a, (first + second) / 2)) <= touch

    for k in range(4):  # a crossing that an end stands for: coincident edges, and tangents that end where they touch
        met &= ~(on[k] & along(t, t_ends[k]))
    once = met[0] & met[1] & along(t[0], t[1])  # a tangency, split in two by rounding
    place[0] = np.where(once, points_at(a, (t[0] + t[1]) / 2), place[0])
    met[1] &= ~once
    cut = [j[on[0]], j[on[1]], i[on[2]], i[on[3]], i[met[0]], j[met[0]], i[met[1]], j[met[1]]]
    points = [*(ends[k][on[k]] for k in range(4)), *(place[k][met[k]] for k in (0, 0, 1, 1))]
    return np.concatenate(cut), np.concatenate(points)


def near_pairs(box: Floats, touch: float) -> tuple[Ints, Ints]:
    """Indices i != j, each pair once, of boxes (n, 4) that overlap or come within ``touch``."""
    order = np.argsort(box[:, 0], kind="stable")
    sorted_ = box[order]
    until = np.searchsorted(sorted_[:, 0], sorted_[:, 2] + touch, side="right")
    ahead = np.maximum(until - np.arange(len(box)) - 1, 0)
    i = np.repeat(np.arange(len(box)), ahead)
    j = i + 1 + np.arange(i.size) - np.repeat(np.cumsum(ahead) - ahead, ahead)
    near = (sorted_[i, 1] <= sorted_[j, 3] + touch) & (sorted_[j, 1] <= sorted_[i, 3] + touch)
    return order[i[near]], order[j[near]]


def shares(e: Edges, q: Complexes) -> Floats:
    """Share of its sweep at which each edge passes the point q on it: with h half the sweep, and s the part of it
    before q, the chords to q are as sin(s) to sin(h - s)."""
    half = 2 * np.arctan(np.maximum(np.abs(e.b), 1e-9))
    near, far = np.abs(q - e.z0), np.abs(q - e.z1)
    return np.asarray(np.arctan2(near * np.sin(half), far + near * np.cos(half)) / half)


def nodes(points: Complexes, touch: float) -> tuple[Ints, Complexes]:
    """The node of each point, and the positions of nodes: points within ``touch``, also by way of others, are one, at
    the place of the first."""
    flat = np.stack([points.real, points.imag, points.real, points.imag], axis=1)
    i, j = near_pairs(flat, touch)
    near = np.abs(points[i] - points[j]) <= touch
    i, j = i[near], j[near]
    label = np.arange(points.size)
    while True:
        least = np.minimum(label[i], label[j])
        before = label.copy()
        np.minimum.at(label, i, least)
        np.minimum.at(label, j, least)
        label = label[label]
        if np.array_equal(before, label):
            return label, points


def merged(net: Network, pieces: Pieces) -> Pieces:
    """Pieces on top of each other as one, the first of them; those that cancel are gone."""
    e = edges_of(net, pieces)
    low, high = np.minimum(pieces.tail, pieces.head), np.maximum(pieces.tail, pieces.head)
    sign = np.where(pieces.tail < pieces.head, 1, -1)
    middle = sign * sagittas(e)
    order = np.lexsort((middle, high, low))
    low, high, middle = low[order], high[order], middle[order]
    same = (low[1:] == low[:-1]) & (high[1:] == high[:-1]) & (middle[1:] - middle[:-1] <= 2 * net.touch)
    begin = np.flatnonzero(np.concatenate([[True], ~same])) if order.size else np.zeros(0, dtype=np.int64)
    if not begin.size:
        return pieces
    first = np.minimum.reduceat(order, begin)
    fall = np.add.reduceat(sign[order], begin) * sign[first]
    return pieces.take(first)._replace(fall=fall).take(np.flatnonzero(fall))


def edges_of(net: Network, pieces: Pieces) -> Edges:
    """The pieces as edges between the places of their nodes."""
    share = pieces.until - pieces.since
    b = np.where(share == 1, net.edges.b[pieces.edge], np.tan(share * np.arctan(net.edges.b[pieces.edge])))
    return Edges(net.at[pieces.tail], net.at[pieces.head], b)
