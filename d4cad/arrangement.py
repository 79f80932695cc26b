"""The loops that bound the points of certain winding numbers, of loops that meet anywhere, exactly on lines and arcs.

Every edge is cut at the nodes where it meets others, and pieces on top of each other become one with a signed
multiplicity. Pieces around a node are sorted by direction, which makes the faces of the plane graph; across a piece the
winding number changes by its multiplicity, so that one number per connected component, taken from the others
around it, settles all of them. The scheme is that of the overlay of subdivisions (de Berg et al., Computational
Geometry, 3rd ed., ch. 2) with curved edges; nothing is decided by the sign of a small number except the order of
directions at a node.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from d4cad.cutting import Ints, Network, Pieces, cut_edges, edges_of, merged
from d4cad.edges import Bools, Edges, Floats, chords, cross, distances, points_along, sector_areas, turns
from d4cad.loop import ROUNDING, Loop

APART = 1e-6
"""Share of the extent by which corners that meet in a point are drawn back into their own material."""

LONGEST = 1.5 * np.pi
"""Sweep up to which arcs of one circle become one arc: the ends stay well apart."""


class Part(NamedTuple):
    """A stretch of a new loop: it starts at ``start`` and has a ``bulge``; ``edge``, ``since`` and ``until`` say of
    which edge it is part (until < since: travelled backwards). ``fixed``: its start must stay a vertex."""

    start: complex
    bulge: float
    edge: int
    since: float
    until: float
    fixed: bool


def positive(winding: Ints) -> Bools:
    """Whether a point is inside by the rule of positive winding numbers."""
    return winding >= 1


def regions(loops: Sequence[Loop], inside: Callable[[Ints], Bools] = positive) -> list[Loop]:
    """Simple loops that bound the points whose winding number is ``inside``, which 0 must not be; inside to the left.

    The loops may cross, touch and overlap themselves and each other. Points within 1e-9 of the extent of all loops are
    one, and what is thinner than that is nothing. An edge that was cut but stays is one edge again, and two
    become one where they were joined on one line or circle. Where material meets in a single point it is parted: the
    corners there are drawn back by APART of the extent, because no solid holds together in a point.
    """
    if not loops:
        return []
    net, pieces = cut_edges(loops)
    pieces = merged(net, pieces)
    if not pieces.edge.size:
        return []
    halves = _halves(net, pieces)
    origin, angle, _ = halves
    turn = _clockwise(origin, angle)
    winding = _windings(net, pieces, turn)
    kept = inside(winding) & ~inside(winding[_twins(winding.size)])
    return _linked(net, pieces, halves, turn, kept)


def _halves(net: Network, pieces: Pieces) -> tuple[Ints, Floats, Floats]:
    """Half-edges, 2k along piece k and 2k + 1 back: the node each leaves, its direction as seen there, and the distance
    at which the direction was taken.

    The direction is that of the point at a distance r, half the shortest chord at the node: tangents do not tell
    touching curves apart. The chord of length r turns from the tangent by asin(r / 2R), and 2R = chord / sin(h).
    """
    e = edges_of(net, pieces)
    chord, half = chords(e), 2 * np.arctan(e.b)
    reach = np.full(net.at.size, np.inf)
    np.minimum.at(reach, pieces.tail, chord / 2)
    np.minimum.at(reach, pieces.head, chord / 2)
    origin = np.stack([pieces.tail, pieces.head], axis=1).ravel()
    bend = np.arcsin(np.clip(np.stack([reach[pieces.tail], reach[pieces.head]]) * np.sin(half) / chord, -1, 1))
    ahead = np.angle(e.z1 - e.z0) - half + bend[0]
    back = np.angle(e.z0 - e.z1) + half - bend[1]
    angle = np.stack([ahead, back], axis=1).ravel() % (2 * np.pi)
    return origin, angle, reach


def _twins(n: int) -> Ints:
    return np.arange(n) ^ 1


def _clockwise(origin: Ints, angle: Floats) -> Ints:
    """For each half-edge the next one clockwise around the node it leaves."""
    order = np.lexsort((angle, origin))
    group = origin[order]
    first = np.searchsorted(group, group, side="left")
    last = np.searchsorted(group, group, side="right") - 1
    place = np.arange(order.size)
    turn = np.empty(order.size, dtype=np.int64)
    turn[order] = order[np.where(place > first, place - 1, last)]
    return turn


def _windings(net: Network, pieces: Pieces, turn: Ints) -> Ints:
    """The winding number to the left of every half-edge."""
    n = turn.size
    face = _faces(turn[_twins(n)])
    fall = np.stack([pieces.fall, -pieces.fall], axis=1).ravel()
    level, part = _levels(face, fall)
    e = edges_of(net, pieces)
    o = e.z0[0]
    area = cross(e.z0 - o, e.z1 - o) / 2 + sector_areas(e)
    faces = np.zeros(level.size)
    np.add.at(faces, face, np.stack([area, -area], axis=1).ravel())
    # The face all around a component is the one that is gone around clockwise.
    order = np.lexsort((faces, part))
    outer = order[np.searchsorted(part[order], np.arange(part.max() + 1))]
    owner = part[face[::2]]
    somewhere = net.at[pieces.tail[np.unique(owner, return_index=True)[1]]]
    base = np.empty(outer.size, dtype=np.int64)
    for k in range(0, outer.size, 256):
        some = np.arange(k, min(k + 256, outer.size))
        around = turns(e, somewhere[some]) * pieces.fall * (owner[None, :] != some[:, None])
        base[some] = around.sum(axis=1)
    return np.asarray((level + (base - level[outer])[part])[face])


def _faces(follow: Ints) -> Ints:
    """Number of the face to the left of each half-edge; ``follow``: the next one around it."""
    face = [-1] * follow.size
    after = follow.tolist()
    count = 0
    for start in range(len(face)):
        if face[start] < 0:
            h = start
            while face[h] < 0:
                face[h] = count
                h = after[h]
            count += 1
    return np.array(face, dtype=np.int64)


def _levels(face: Ints, fall: Ints) -> tuple[Ints, Ints]:
    """For each face its winding number less that of one face of its component, and the component's number."""
    beside: list[list[tuple[int, int]]] = [[] for _ in range(int(face.max()) + 1)]
    for h, (left, drop) in enumerate(zip(face.tolist(), fall.tolist(), strict=True)):
        beside[left].append((int(face[h ^ 1]), drop))
    level, part = [0] * len(beside), [-1] * len(beside)
    count = 0
    for start in range(len(beside)):
        if part[start] >= 0:
            continue
        part[start] = count
        waiting = [start]
        while waiting:
            f = waiting.pop()
            for other, drop in beside[f]:
                if part[other] < 0:
                    part[other], level[other] = count, level[f] - drop
                    waiting.append(other)
        count += 1
    return np.array(level, dtype=np.int64), np.array(part, dtype=np.int64)


def _linked(net: Network, pieces: Pieces, halves: tuple[Ints, Floats, Floats], turn: Ints, kept: Bools) -> list[Loop]:
    """Loops of the kept half-edges. At a node each corner takes in one sector of the inside: from where it comes it
    goes out by the next kept half-edge clockwise."""
    origin, angle, reach = halves
    degree = np.bincount(origin[kept], minlength=net.at.size)
    bulge = edges_of(net, pieces).b.tolist()
    after: dict[int, int] = {}
    moved: dict[int, complex] = {}
    for h in np.flatnonzero(kept).tolist():
        g = int(turn[h ^ 1])
        while not kept[g]:
            g = int(turn[g])
        after[h] = g
        node = int(origin[g])
        if degree[node] > 1:
            back = min(APART / ROUNDING * net.touch, 0.1 * float(reach[node]))
            opening = (angle[h ^ 1] - angle[g]) % (2 * np.pi)
            moved[g] = back * complex(np.exp(1j * (angle[g] + opening / 2)))
    loops = []
    while after:
        h = next(iter(after))
        parts = []
        while h in after:
            k, backwards = divmod(h, 2)
            start = complex(net.at[origin[h]]) + moved.get(h, 0j)
            ends = (float(pieces.since[k]), float(pieces.until[k]))
            since, until = ends[::-1] if backwards else ends
            parts.append(
                Part(start, -bulge[k] if backwards else bulge[k], int(pieces.edge[k]), since, until, h in moved)
            )
            h = after.pop(h)
        loop = _loop(net, parts)
        if loop is not None:
            loops.append(loop)
    return loops


def _loop(net: Network, parts: list[Part]) -> Loop | None:
    """The loop of these parts with as few edges as the cuts allow, or None if it encloses nothing."""
    n = len(parts)
    first = next((k for k in range(n) if not _continues(parts[k - 1], parts[k])), 0)
    fewer: list[Part] = []
    for part in parts[first:] + parts[:first]:
        if fewer and _continues(fewer[-1], part):
            last = fewer[-1]
            share = part.until - last.since
            whole = float(net.edges.b[part.edge])
            bulge = float(np.tan(share * np.arctan(whole))) if abs(share) < 1 else share * whole
            fewer[-1] = last._replace(bulge=bulge, until=part.until)
        else:
            fewer.append(part)
    fewer = _fused(net, fewer)
    if len(fewer) < 2:
        return None
    k = min(range(len(fewer)), key=lambda i: fewer[i].edge)  # a loop that stayed starts where it did
    fewer = fewer[k:] + fewer[:k]
    loop = Loop(tuple((p.start.real, p.start.imag) for p in fewer), tuple(p.bulge + 0.0 for p in fewer))
    return loop if abs(loop.area) > net.touch * loop.length else None


def _continues(a: Part, c: Part) -> bool:
    """Whether c goes on where a ends on the same edge."""
    return not c.fixed and a.edge == c.edge and a.until == c.since and (a.until - a.since) * (c.until - c.since) > 0


def _fused(net: Network, parts: list[Part]) -> list[Part]:
    """Parts of different edges on one line or circle as one, unless they follow each other in a given loop."""
    k = 0
    while k < len(parts) and len(parts) > 2:
        a, c = parts[k - 1], parts[k]
        bulge = None if c.fixed else _common(net, a, c, parts[(k + 1) % len(parts)].start)
        if bulge is None:
            k += 1
        else:
            parts[k - 1] = a._replace(bulge=bulge, since=np.nan, until=np.nan)  # no longer a part of one edge
            del parts[k]
    return parts


def _common(net: Network, a: Part, c: Part, end: complex) -> float | None:
    """The bulge of the one edge that stands for both, or None."""
    reach = LONGEST
    ahead = a.until == 1 and c.since == 0 and net.following[a.edge] == c.edge
    back = a.until == 0 and c.since == 1 and net.following[c.edge] == a.edge
    if ahead or back:
        given = float(net.halves[a.edge if ahead else c.edge])
        if given == 0:
            return None
        if abs(a.until - a.since) == 1 == abs(c.until - c.since):
            return given if ahead else -given
        reach = np.inf
    quarter = float(np.arctan(a.bulge) + np.arctan(c.bulge))
    kink = np.angle((end - c.start) / (c.start - a.start)) - 2 * quarter
    if abs((kink + np.pi) % (2 * np.pi) - np.pi) > 1e-3 or abs(4 * quarter) > reach:
        return None
    bulge = 0.0 if a.bulge == 0 == c.bulge else float(np.tan(quarter))
    one = Edges(np.array([a.start]), np.array([end]), np.array([bulge]))
    both = Edges(np.array([a.start, c.start]), np.array([c.start, end]), np.array([a.bulge, c.bulge]))
    seen = np.append(points_along(both, np.full(2, 0.5)), c.start)
    return bulge if np.all(distances(one, seen) <= 2 * net.touch) else None
