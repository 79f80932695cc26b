"""The boundary of the non-zero region of loops that meet anywhere, compiled. All in pixels.

Edges are cut into pieces at the nodes where they meet. A piece stays if the winding number is zero on one side of it
only, and is turned so that the inside is left. The pieces that stay are linked into loops that do not cross and,
where several pass through one node, are pulled apart there.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from d4cad.grammars.arc_line.crossings import FLATTEST, SNAP, root_of
from d4cad.grammars.arc_line.curves import apex, arc_length, sub_bulge, winding
from d4cad.raster.pieces import BULGE, CX, LENGTH, SX, X0, Y0

SAME = 1e-5
"""Pieces between the same nodes whose middles are this near (px) are one."""
BESIDE = 2e-5
"""How far (px) to either side of an edge the winding number is asked first; nearer where other edges are in between."""
APART = 1e-3
"""How far (px) corners that share a node are pulled apart."""

EDGE, TAIL, HEAD, AFTER, BEFORE = range(5)
"""Columns of the pieces (k, 5): the edge, the nodes at both ends, the pieces that follow and precede along the loop."""
FROM, TO, LONG = range(3)
"""Columns of their spans (k, 3): shares of the edge where they begin and end, and their length (px)."""

UNKNOWN = 2
"""In place of a piece's sign: the winding numbers beside it do not differ as they must."""

GOOD, NEW, FAILED = range(3)
"""Outcomes of `boundary`; it fails where rounding contradicts itself."""

TURN = 2.0 * math.pi


@nb.njit(cache=True)
def place_on(table, e, at):
    """Point of an edge at a share of its sweep, and the angle of its tangent there.

    The chord from the start to it is L sin(at h) / sin(h) long, h half the sweep, and turned by (at - 1) h.
    """
    b, length = table[e, BULGE], table[e, LENGTH]
    heading = math.atan2(table[e, SX], table[e, CX])
    if abs(b) <= FLATTEST:
        return table[e, X0] + at * length * table[e, CX], table[e, Y0] + at * length * table[e, SX], heading
    half = 2.0 * math.atan(b)
    reach = length * math.sin(at * half) / math.sin(half)
    angle = heading + (at - 1.0) * half
    x, y = table[e, X0] + reach * math.cos(angle), table[e, Y0] + reach * math.sin(angle)
    return x, y, heading + (2.0 * at - 1.0) * half


@nb.njit(cache=True)
def sides(table, x, y, b, nxt, e, at, beside):
    """Winding numbers of all loops at a distance left and right of an edge at a share of it."""
    px, py, tangent = place_on(table, e, at)
    dx, dy = -beside * math.sin(tangent), beside * math.cos(tangent)
    return winding(x, y, b, nxt, px + dx, py + dy), winding(x, y, b, nxt, px - dx, py - dy)


@nb.njit(cache=True)
def boundary(table, x, y, b, arc, nxt, cut_edge, at, node, px, py, parent, met):
    """Loops that bound the non-zero region of the given ones, from what `meetings` returns of those.

    Returns (x, y, b, arc, nxt, vertex, edge, outcome); vertex, edge (n,): the given vertex and edge that each new one
    continues, or -1; outcome: GOOD, the given loops do so themselves, NEW or FAILED.
    """
    pieces, span = _cut(x, y, b, nxt, cut_edge, at, node, parent)
    weight = _weights(table, pieces, span, met)
    sign = _signs(table, x, y, b, nxt, pieces, span, weight, met)
    same = np.arange(x.shape[0])
    if (sign == 1).all() and not met.any():
        return x, y, b, arc, nxt, same, same, GOOD
    follow, fused, moved = _link(table, pieces, span, weight, sign, met)
    if ((sign == UNKNOWN) | ((sign != 0) & (follow < 0))).any():
        return x, y, b, arc, nxt, same, same, FAILED
    x2, y2, b2, arc2, nxt2, vertex, edge = _stitch(x, y, b, arc, nxt, px, py, pieces, span, sign, follow, fused, moved)
    return x2, y2, b2, arc2, nxt2, vertex, edge, NEW


@nb.njit(cache=True)
def _cut(x, y, b, nxt, cut_edge, at, node, parent):
    """Pieces (k, 5) and their spans (k, 3), edge after edge."""
    n, cuts = x.shape[0], cut_edge.shape[0]
    order = np.argsort(at, kind="mergesort")
    order = order[np.argsort(cut_edge[order], kind="mergesort")]
    pieces = np.empty((n + cuts, 5), np.int64)
    span = np.empty((n + cuts, 3))
    first = np.empty(n, np.int64)
    k = c = 0
    for e in range(n):
        first[e] = k
        length = arc_length(x[e], y[e], x[nxt[e]], y[nxt[e]], b[e])
        tail, since = root_of(parent, e), 0.0
        while c < cuts and cut_edge[order[c]] == e:
            head, until = root_of(parent, node[order[c]]), at[order[c]]
            pieces[k, EDGE], pieces[k, TAIL], pieces[k, HEAD] = e, tail, head
            span[k, FROM], span[k, TO], span[k, LONG] = since, until, (until - since) * length
            tail, since = head, until
            k += 1
            c += 1
        pieces[k, EDGE], pieces[k, TAIL], pieces[k, HEAD] = e, tail, root_of(parent, nxt[e])
        span[k, FROM], span[k, TO], span[k, LONG] = since, 1.0, (1.0 - since) * length
        k += 1
    for p in range(k):
        e = pieces[p, EDGE]
        after = p + 1 if p + 1 < k and pieces[p + 1, EDGE] == e else first[nxt[e]]
        pieces[p, AFTER] = after
        pieces[after, BEFORE] = p
    return pieces, span


@nb.njit(cache=True)
def _weights(table, pieces, span, met):
    """By how much the winding number falls across each piece from left to right, (k,).

    Pieces on top of each other count as the first of them, which has the sum; the others and mere points have 0.
    """
    count = pieces.shape[0]
    weight = np.ones(count, np.int64)
    ends = np.empty(count, np.int64)
    middle = np.empty((count, 2))
    shared = 0
    for p in range(count):
        if not (met[pieces[p, TAIL]] and met[pieces[p, HEAD]]):
            continue
        if pieces[p, TAIL] == pieces[p, HEAD] and span[p, LONG] <= 10.0 * SNAP:
            weight[p] = 0
            continue
        mx, my, _ = place_on(table, pieces[p, EDGE], 0.5 * (span[p, FROM] + span[p, TO]))
        middle[shared, 0], middle[shared, 1] = mx, my
        ends[shared] = p
        for s in range(shared):
            q = ends[s]
            if abs(middle[s, 0] - mx) > SAME or abs(middle[s, 1] - my) > SAME:
                continue
            if pieces[p, TAIL] == pieces[q, TAIL] and pieces[p, HEAD] == pieces[q, HEAD]:
                weight[p], weight[q] = 0, weight[q] + 1
                break
            if pieces[p, TAIL] == pieces[q, HEAD] and pieces[p, HEAD] == pieces[q, TAIL]:
                weight[p], weight[q] = 0, weight[q] - 1
                break
        else:
            shared += 1
    return weight


@nb.njit(cache=True)
def _signs(table, x, y, b, nxt, pieces, span, weight, met):
    """1 for pieces that bound the region, -1 for those that bound it the wrong way round, 0 for all others or UNKNOWN,
    (k,).

    From one meeting to the next the winding numbers beside a loop do not change: they are asked once, where the stretch
    is longest, and only if that contradicts the weight elsewhere.
    """
    count = pieces.shape[0]
    sign = np.zeros(count, np.int64)
    seen = np.zeros(count, np.bool_)
    for whole in range(2):  # stretches between meetings, then loops without any
        for start in range(count):
            if seen[start] or not (whole or met[pieces[start, TAIL]]):
                continue
            longest, p = start, start
            while not seen[p]:
                seen[p] = True
                if span[p, LONG] > span[longest, LONG]:
                    longest = p
                last = p
                p = pieces[p, AFTER]
                if met[pieces[last, HEAD]]:
                    break
            if weight[start] == 0:
                continue
            verdict = _verdict(table, x, y, b, nxt, pieces, span, longest, weight[start], 0.5, BESIDE)
            beside = BESIDE
            while verdict == UNKNOWN and beside > 1e-4 * BESIDE:
                p = start
                while verdict == UNKNOWN:
                    for k in range(1, 4):
                        if verdict == UNKNOWN:
                            verdict = _verdict(table, x, y, b, nxt, pieces, span, p, weight[start], 0.25 * k, beside)
                    if p == last:
                        break
                    p = pieces[p, AFTER]
                beside *= 0.03
            p = start
            while True:
                sign[p] = verdict
                if p == last:
                    break
                p = pieces[p, AFTER]
    return sign


@nb.njit(cache=True)
def _verdict(table, x, y, b, nxt, pieces, span, p, weight, part, beside):
    """The sign of a piece as seen beside a part of it; UNKNOWN if the winding numbers there contradict its weight."""
    at = (1.0 - part) * span[p, FROM] + part * span[p, TO]
    left, right = sides(table, x, y, b, nxt, pieces[p, EDGE], at, beside)
    if left - right != weight:
        return UNKNOWN
    if (left == 0) == (right == 0):
        return 0
    return 1 if right == 0 else -1


@nb.njit(cache=True)
def _link(table, pieces, span, weight, sign, met):
    """For each kept piece the one that follows (-1: rounding contradicted itself), whether both are parts of one edge
    that need no vertex between them, and by how much (x, y) the vertex before it is moved; (k,), (k,), (k, 2)."""
    count = pieces.shape[0]
    follow = np.full(count, -1)
    fused = np.zeros(count, np.bool_)
    moved = np.zeros((count, 2))
    # Pieces that leave a node and pieces that come to it, as linked lists.
    leaving, coming = np.full(met.shape[0], -1), np.full(met.shape[0], -1)
    next_out, next_in = np.full(count, -1), np.full(count, -1)
    for p in range(count):
        if sign[p] == 0:
            continue
        out, into = (pieces[p, TAIL], pieces[p, HEAD]) if sign[p] > 0 else (pieces[p, HEAD], pieces[p, TAIL])
        next_out[p], leaving[out] = leaving[out], p
        next_in[p], coming[into] = coming[into], p
    for node in range(met.shape[0]):
        p, q = coming[node], leaving[node]
        if p < 0 or q < 0:
            continue
        if next_in[p] < 0 and next_out[q] < 0:
            follow[p] = q
            fused[p] = met[node] and _continues(pieces, weight, sign, p) == q and pieces[p, EDGE] == pieces[q, EDGE]
        else:
            _link_node(table, pieces, span, weight, sign, p, q, next_in, next_out, follow, fused, moved)
    return follow, fused, moved


@nb.njit(cache=True)
def _continues(pieces, weight, sign, p):
    """The piece that continues p along its own loop in the direction of its sign, points left out; -1 if it is turned
    the other way."""
    column = AFTER if sign[p] > 0 else BEFORE
    q = pieces[p, column]
    while weight[q] == 0 and q != p:
        q = pieces[q, column]
    return q if sign[q] == sign[p] else -1


@nb.njit(cache=True)
def _link_node(table, pieces, span, weight, sign, first_in, first_out, next_in, next_out, follow, fused, moved):
    """Link the pieces at a node where several loops pass, and pull their corners apart.

    Loops that only touch go on as they came. Otherwise each corner takes in one sector of the inside: it goes out by
    the next piece clockwise from where it came.
    """
    degree, p = 0, first_in
    while p >= 0:
        degree += 1
        p = next_in[p]
    ins, outs = np.empty(degree, np.int64), np.full(degree, -1)
    k, p, q = 0, first_in, first_out
    reach = np.inf
    while p >= 0 and q >= 0:
        ins[k], outs[k] = p, q
        reach = min(reach, _reach(table, pieces, span, p), _reach(table, pieces, span, q))
        k, p, q = k + 1, next_in[p], next_out[q]
    if p >= 0 or q >= 0:
        return
    come, go = np.empty(degree), np.empty(degree)
    for k in range(degree):
        come[k] = _direction(table, pieces, span, ins[k], sign[ins[k]] > 0, 0.5 * reach)
        go[k] = _direction(table, pieces, span, outs[k], sign[outs[k]] < 0, 0.5 * reach)
    chosen = np.full(degree, -1)
    natural = True
    for k in range(degree):
        on = _continues(pieces, weight, sign, ins[k])
        for m in range(degree):
            if outs[m] == on:
                chosen[k] = m
        natural = natural and chosen[k] >= 0
    if not natural:
        for k in range(degree):
            chosen[k] = np.argmin((come[k] - go) % TURN)
    taken = np.zeros(degree, np.bool_)
    for k in range(degree):
        if taken[chosen[k]]:
            return
        taken[chosen[k]] = True
    whole = 0
    for k in range(degree):
        follow[ins[k]] = outs[chosen[k]]
        fused[ins[k]] = natural and pieces[ins[k], EDGE] == pieces[outs[chosen[k]], EDGE]
        whole += fused[ins[k]]
    for k in range(degree):
        if whole > 1:
            fused[ins[k]] = False
        if fused[ins[k]]:
            continue
        # Into the corner's inside, unless that is where the others are.
        inside = (come[k] - go[chosen[k]]) % TURN
        toward = come[k] - 0.5 * inside
        for m in range(degree):
            if m != chosen[k] and (come[k] - go[m]) % TURN < inside:
                toward = come[k] + 0.5 * (TURN - inside)
        moved[outs[chosen[k]], 0], moved[outs[chosen[k]], 1] = APART * math.cos(toward), APART * math.sin(toward)


@nb.njit(cache=True)
def _reach(table, pieces, span, p):
    """The largest distance from its ends up to which a piece keeps going away from them."""
    e = pieces[p, EDGE]
    b = table[e, BULGE]
    sweep = 4.0 * math.atan(abs(b)) * (span[p, TO] - span[p, FROM])
    if sweep < 1e-9:
        return span[p, LONG]
    return 2.0 * span[p, LONG] / sweep * math.sin(min(0.5 * sweep, 0.5 * math.pi))


@nb.njit(cache=True)
def _direction(table, pieces, span, p, from_end, reach):
    """The angle under which the point of a piece at distance ``reach`` is seen from its start or its end."""
    e = pieces[p, EDGE]
    b = table[e, BULGE]
    _, _, tangent = place_on(table, e, span[p, TO] if from_end else span[p, FROM])
    bend = 4.0 * b / (table[e, LENGTH] * (1.0 + b * b))
    turn = math.asin(max(-1.0, min(1.0, 0.5 * reach * bend)))
    return tangent + math.pi - turn if from_end else tangent + turn


@nb.njit(cache=True)
def _stitch(x, y, b, arc, nxt, px, py, pieces, span, sign, follow, fused, moved):
    """The kept pieces as linked edges, fused ones as one."""
    n, count = x.shape[0], pieces.shape[0]
    number = np.full(count, -1)  # of the vertex before each piece
    inner = np.zeros(count, np.bool_)
    total = 0
    for p in range(count):
        if sign[p] != 0:
            inner[follow[p]] = fused[p]
            total += not fused[p]
    room = 2 * total
    x2, y2, b2 = np.empty(room), np.empty(room), np.empty(room)
    arc2, nxt2 = np.empty(room, np.bool_), np.empty(room, np.int64)
    vertex, edge = np.full(room, -1), np.full(room, -1)
    k = 0
    for p in range(count):
        if sign[p] != 0 and not inner[p]:
            node = pieces[p, TAIL] if sign[p] > 0 else pieces[p, HEAD]
            vertex[k] = node if node < n else -1
            x2[k] = (x[node] if node < n else px[node - n]) + moved[p, 0]
            y2[k] = (y[node] if node < n else py[node - n]) + moved[p, 1]
            number[p] = k
            k += 1
    for p in range(count):
        i = number[p]
        if i < 0:
            continue
        e, last = pieces[p, EDGE], p
        while fused[last]:
            last = follow[last]
        begin, end = (p, last) if sign[p] > 0 else (last, p)
        j = number[follow[last]]
        arc2[i], nxt2[i] = arc[e], j
        whole = span[begin, FROM] == 0.0 and span[end, TO] == 1.0
        if whole and sign[p] > 0:
            edge[i] = e
        b2[i] = sign[p] * (b[e] if whole else sub_bulge(b[e], span[end, TO] - span[begin, FROM]))
        if i == j:  # a full circle: two edges
            x2[k], y2[k] = apex(x[e], y[e], x[nxt[e]], y[nxt[e]], b[e])
            b2[i] = b2[k] = sub_bulge(b2[i], 0.5)
            arc2[k], nxt2[k], nxt2[i] = arc[e], i, k
            k += 1
    return x2[:k], y2[:k], b2[:k], arc2[:k], nxt2[:k], vertex[:k], edge[:k]
