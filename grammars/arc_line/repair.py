"""Repair: the nearest well-formed loops that bound the same non-zero region, compiled. All in pixels.

Well-formed: edges meet only where they follow each other, the winding number is 0 or 1 everywhere (so the inside is
left of every edge), no loop is under a least area and no edge under a least length.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from d4cad.grammars.arc_line.arrangement import FAILED, GOOD, boundary
from d4cad.grammars.arc_line.crossings import boxes, meetings
from d4cad.grammars.arc_line.curves import arc_length, loop_area
from d4cad.raster.pieces import edge_table, monotone_pieces

LEAST_AREA = 2.0
"""Loops of less than this many square pixels are dropped."""
LEAST_LENGTH = 0.1
"""Edges shorter than this many pixels are dropped."""
PASSES = 10
JITTER = 1e-3
"""Where rounding contradicts itself, vertices are moved by up to so many pixels, twice as far in each later pass."""


@nb.njit(cache=True)
def repair(x, y, b, arc, nxt):
    """Repair linked loops.

    Returns (x, y, b, arc, sizes, vertex, edge, changed): the loops stored one after another, sizes (loops,) int64,
    vertex and edge (n,) int64: the old vertex whose place, the old edge whose bulge each new one keeps, or -1.
    A shape of which nothing would remain comes back unchanged.
    """
    n = x.shape[0]
    given = (x, y, b, arc, nxt, np.arange(n), np.arange(n))
    loops = given
    changed = False
    for step in range(PASSES):
        loops, short = _without_short(loops)
        loops, outcome = _well_wound(loops, step)
        if loops[0].shape[0] == 0:
            loops = given
            changed = False
            break
        loops, small = _without_small(loops)
        if not short and outcome == GOOD and not small:
            break
        changed = True
    x, y, b, arc, nxt, vertex, edge, sizes = compact(*loops, np.ones(loops[0].shape[0], np.bool_))
    return x, y, b, arc, sizes, vertex, edge, changed


@nb.njit(cache=True)
def _well_wound(loops, step):
    """The loops that bound the non-zero region of ``loops``, inside on their left, and how that went."""
    x, y, b, arc, nxt, vertex, edge = loops
    n = x.shape[0]
    table = edge_table(x, y, b, nxt)
    owner, ends = np.empty(5 * n, np.int64), np.empty((5 * n, 4))
    pieces = monotone_pieces(table, x, y, nxt, owner, ends)
    cut_edge, at, node, px, py, parent, met = meetings(table, x, y, nxt, boxes(owner, ends, pieces, n))
    x2, y2, b2, arc2, nxt2, from_vertex, from_edge, outcome = boundary(
        table, x, y, b, arc, nxt, cut_edge, at, node, px, py, parent, met
    )
    if outcome == GOOD:
        return loops, outcome
    if outcome == FAILED:
        far = JITTER * 2.0**step
        x2 = x + far * np.sin(12.9898 * np.arange(n) + 78.233 * step)
        y2 = y + far * np.sin(39.3467 * np.arange(n) + 11.135 * step)
        return (x2, y2, b, arc, nxt, vertex, edge), outcome
    for k in range(x2.shape[0]):
        from_vertex[k] = vertex[from_vertex[k]] if from_vertex[k] >= 0 else -1
        from_edge[k] = edge[from_edge[k]] if from_edge[k] >= 0 else -1
    return (x2, y2, b2, arc2, nxt2, from_vertex, from_edge), outcome


@nb.njit(cache=True)
def _without_small(loops):
    """The loops of at least the least area, or the largest if there is none, and whether any went."""
    x, y, b, arc, nxt, vertex, edge = loops
    n = x.shape[0]
    keep = np.ones(n, np.bool_)
    seen = np.zeros(n, np.bool_)
    largest, most = 0, -1.0
    small = False
    for start in range(n):
        if seen[start]:
            continue
        area = abs(loop_area(x, y, b, nxt, start))
        if area > most:
            largest, most = start, area
        small |= area < LEAST_AREA
        i = start
        while not seen[i]:
            seen[i] = True
            keep[i] = area >= LEAST_AREA
            i = nxt[i]
    if not keep.any():
        i = largest
        while not keep[i]:
            keep[i] = True
            i = nxt[i]
    if not small or keep.all():
        return loops, False
    x, y, b, arc, nxt, vertex, edge, _ = compact(x, y, b, arc, nxt, vertex, edge, keep)
    return (x, y, b, arc, nxt, vertex, edge), True


@nb.njit(cache=True)
def _without_short(loops):
    """The loops without edges under the least length, two edges a loop kept, and whether any went.

    Where edge i goes, so does the vertex at its end, and the next edge starts at vertex i, which keeps its place. That
    edge's bulge keeps its sagitta, or an arc that is nearly a circle would swell with its chord.
    """
    x, y, b, arc, nxt, vertex, edge = loops
    n = x.shape[0]
    for i in range(n):
        if arc_length(x[i], y[i], x[nxt[i]], y[nxt[i]], b[i]) < LEAST_LENGTH:
            break
    else:
        return loops, False
    b, arc, nxt, edge = b.copy(), arc.copy(), nxt.copy(), edge.copy()
    keep = np.ones(n, np.bool_)
    seen = np.zeros(n, np.bool_)
    for start in range(n):
        if seen[start] or not keep[start]:
            continue
        size, i = 0, start
        while not seen[i]:
            seen[i] = True
            size += 1
            i = nxt[i]
        for _ in range(size):
            j = nxt[i]
            k = nxt[j]
            chord = math.hypot(x[k] - x[i], y[k] - y[i])
            short = arc_length(x[i], y[i], x[j], y[j], b[i]) < LEAST_LENGTH
            if short and size > 2 and (b[j] == 0.0 or chord > 0.0):
                b[i] = b[j] * math.hypot(x[k] - x[j], y[k] - y[j]) / chord if b[j] != 0.0 else 0.0
                arc[i], edge[i], nxt[i] = arc[j], edge[j], k
                keep[j] = False
                size -= 1
            else:
                i = j
    x, y, b, arc, nxt, vertex, edge, _ = compact(x, y, b, arc, nxt, vertex, edge, keep)
    return (x, y, b, arc, nxt, vertex, edge), not keep.all()


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
