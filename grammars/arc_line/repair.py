"""Repair: the nearest well-formed loops that bound the same non-zero region.

Well-formed: no two edges cross, the winding number is 0 or 1 everywhere (so the inside is left of every edge), no
loop is under a least area and no edge under a least length.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from d4cad.grammars.arc_line.crossings import crossings
from d4cad.grammars.arc_line.curves import apex, arc_length, loop_area, sub_bulge, winding
from d4cad.raster.scan import edge_table, monotone_pieces

LEAST_AREA = 2.0
"""Loops of less than this many square pixels are dropped."""
LEAST_LENGTH = 0.1
"""Edges shorter than this many pixels are dropped."""
PASSES = 4
BESIDE = 1e-6
"""How far (px) to the left of an edge the winding number is asked."""


@nb.njit(cache=True)
def repair(x, y, b, arc, nxt):
    """Repair linked loops given in pixels.

    Returns (x, y, b, arc, sizes, vertex, edge, changed): the loops stored one after another, sizes (loops,) int64,
    vertex and edge (n,) int64: the old vertex whose place, the old edge whose bulge each new one keeps, or -1.
    A shape of which nothing would remain comes back unchanged.
    """
    n = x.shape[0]
    vertex = np.arange(n)
    edge = np.arange(n)
    changed = False
    for _ in range(PASSES):
        table = edge_table(x, y, b, nxt)
        owner = np.empty(5 * x.shape[0], np.int64)
        ends = np.empty((5 * x.shape[0], 4))
        pieces = monotone_pieces(table, x, y, nxt, owner, ends)
        cut_edge, at, px, py = crossings(table, x, y, nxt, owner, ends, pieces)
        if cut_edge.shape[0] > 0:
            x2, y2, b2, arc2, nxt2, vertex, edge = _uncross(x, y, b, arc, nxt, vertex, edge, cut_edge, at, px, py)
            changed = True
        else:
            x2, y2, b2, arc2, nxt2 = x.copy(), y.copy(), b.copy(), arc.copy(), nxt.copy()
        keep = np.ones(x2.shape[0], np.bool_)
        if _orient(x2, y2, b2, arc2, nxt2, edge, keep, x, y, b, nxt):
            changed = True
        if _drop_short(x2, y2, b2, arc2, nxt2, edge, keep):
            changed = True
        if not keep.any():
            break
        x, y, b, arc, nxt, vertex, edge, sizes = compact(x2, y2, b2, arc2, nxt2, vertex, edge, keep)
        if cut_edge.shape[0] == 0:
            return x, y, b, arc, sizes, vertex, edge, changed
    x, y, b, arc, nxt, vertex, edge, sizes = compact(x, y, b, arc, nxt, vertex, edge, np.ones(x.shape[0], np.bool_))
    return x, y, b, arc, sizes, vertex, edge, changed


@nb.njit(cache=True)
def _uncross(x, y, b, arc, nxt, vertex, edge, cut_edge, at, px, py):
    """Cut both edges at every crossing and swap the successors there, so that orientation is preserved.

    Crossing c makes the vertices n + 2c and n + 2c + 1, the starts of the outgoing pieces of its two edges; the piece
    that comes in along one edge goes out along the other.
    """
    n, cuts = x.shape[0], cut_edge.shape[0]
    x2, y2, b2 = np.concatenate((x, px)), np.concatenate((y, py)), np.concatenate((b, np.zeros(cuts)))
    arc2 = np.concatenate((arc, np.zeros(cuts, np.bool_)))
    nxt2 = np.concatenate((nxt, np.zeros(cuts, np.int64)))
    vertex2 = np.concatenate((vertex, np.full(cuts, -1)))
    edge2 = np.concatenate((edge, np.full(cuts, -1)))
    order = np.argsort(at, kind="mergesort")
    order = order[np.argsort(cut_edge[order], kind="mergesort")]
    k = 0
    while k < cuts:
        e = cut_edge[order[k]]
        b_whole, target = b[e], nxt[e]
        tail, since = e, 0.0
        while k < cuts and cut_edge[order[k]] == e:
            c = order[k]
            b2[tail] = sub_bulge(b_whole, at[c] - since)
            arc2[tail] = arc[e]
            nxt2[tail] = n + (c ^ 1)
            tail, since = n + c, at[c]
            k += 1
        b2[tail] = sub_bulge(b_whole, 1.0 - since)
        arc2[tail] = arc[e]
        nxt2[tail] = target
        edge2[e] = -1
    return x2, y2, b2, arc2, nxt2, vertex2, edge2


@nb.njit(cache=True)
def _orient(x2, y2, b2, arc2, nxt2, edge, keep, x, y, b, nxt):
    """Keep the loops that bound the non-zero region of the original loops (x, y, b, nxt), inside on their left.

    The winding number w just left of a loop (right of it: w - 1) is asked of the *original* loops, beside the apex of
    the loop's longest edge: w = 1 bounds the region, w = 0 bounds it the wrong way round, any other w separates two
    inside regions. Loops under the least area go too, unless all would. Returns whether anything changed.
    """
    n = x2.shape[0]
    seen = np.zeros(n, np.bool_)
    changed = False
    largest, largest_area = -1, 0.0
    kept_any = False
    loop_of = np.empty(n, np.int64)
    for start in range(n):
        if seen[start]:
            continue
        i, longest, length = start, start, -1.0
        while not seen[i]:
            seen[i] = True
            loop_of[i] = start
            size = arc_length(x2[i], y2[i], x2[nxt2[i]], y2[nxt2[i]], b2[i])
            if size > length:
                longest, length = i, size
            i = nxt2[i]
        j = nxt2[longest]
        ax, ay = apex(x2[longest], y2[longest], x2[j], y2[j], b2[longest])
        dx, dy = x2[j] - x2[longest], y2[j] - y2[longest]
        chord = math.hypot(dx, dy)
        bounds = False
        area = abs(loop_area(x2, y2, b2, nxt2, start))
        if chord > 0.0:
            # Left of travel is (-dy, dx); at the apex the tangent is parallel to the chord.
            w = winding(x, y, b, nxt, ax - BESIDE * dy / chord, ay + BESIDE * dx / chord)
            bounds = w == 0 or w == 1
            if w == 0:
                _reverse(b2, arc2, nxt2, edge, start)
                changed = True
            if bounds and area > largest_area:
                largest, largest_area = start, area
        if not bounds or area < LEAST_AREA:
            i = start
            while keep[i]:
                keep[i] = False
                i = nxt2[i]
            changed = True
        else:
            kept_any = True
    if not kept_any and largest >= 0:
        for i in range(n):
            if loop_of[i] == largest:
                keep[i] = True
    return changed


@nb.njit(cache=True)
def _reverse(b, arc, nxt, edge, start):
    """Turn a loop round in place: edge i, which ran i -> nxt, becomes the edge at its old end with bulge -b."""
    i, before = start, -1
    before_b, before_arc = 0.0, False
    while True:
        after, bi, ai = nxt[i], b[i], arc[i]
        nxt[i], b[i], arc[i], edge[i] = before, -before_b, before_arc, -1
        before, before_b, before_arc = i, bi, ai
        i = after
        if i == start:
            break
    nxt[start], b[start], arc[start], edge[start] = before, -before_b, before_arc, -1


@nb.njit(cache=True)
def _drop_short(x, y, b, arc, nxt, edge, keep):
    """Take out edges under the least length, and loops left with fewer than two edges. Returns whether any went."""
    n = x.shape[0]
    seen = np.zeros(n, np.bool_)
    changed = False
    for start in range(n):
        if seen[start] or not keep[start]:
            continue
        size = 0
        i = start
        while not seen[i]:
            seen[i] = True
            size += 1
            i = nxt[i]
        i, steps = start, size
        while steps > 0 and size > 2:
            j = nxt[i]
            if arc_length(x[i], y[i], x[j], y[j], b[i]) < LEAST_LENGTH and j != i:
                # Vertex j goes: its outgoing edge now starts at i, which keeps its place. The neighbour moves by less
                # than the least length.
                b[i], edge[i] = b[j], edge[j]
                nxt[i] = nxt[j]
                keep[j] = False
                arc[i] = arc[j]
                size -= 1
                changed = True
            else:
                i = j
            steps -= 1
    return changed


@nb.njit(cache=True)
def compact(x, y, b, arc, nxt, vertex, edge, keep):
    """Store the kept loops one after another.

    Returns (x, y, b, arc, nxt, vertex, edge, sizes), sizes (loops,) int64.
    """
    n = x.shape[0]
    order = np.empty(n, np.int64)
    sizes = np.empty(n, np.int64)
    seen = np.zeros(n, np.bool_)
    count = 0
    loops = 0
    for start in range(n):
        if seen[start] or not keep[start]:
            continue
        begin = count
        i = start
        while not seen[i]:
            seen[i] = True
            order[count] = i
            count += 1
            i = nxt[i]
        sizes[loops] = count - begin
        loops += 1
    order = order[:count]
    new_nxt = np.arange(1, count + 1)
    begin = 0
    for k in range(loops):
        new_nxt[begin + sizes[k] - 1] = begin
        begin += sizes[k]
    return x[order], y[order], b[order], arc[order], new_nxt, vertex[order], edge[order], sizes[:loops]
