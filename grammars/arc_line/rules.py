"""The rewrites of the Arc-Line grammar on linked loops, compiled.

A rule changes arrays in place that have room for new vertices behind the ``n`` in use; a vertex that goes is left
pointing at itself. So rewrites at disjoint sites can be applied one after another with the original numbers.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numba as nb
import numpy as np

from d4cad.grammars.arc_line.curves import apex, arc_length, bulge_through, point_along, sub_bulge, turn_at


class Rule(IntEnum):
    """Rewrites, by what they do to edge i (from vertex i) or at vertex j between the edges before and after it."""

    SPLIT = 0
    """Edge i into two of its kind, at its apex."""
    TO_ARC = 1
    """Line i becomes an arc of bulge 0."""
    TO_LINE = 2
    """Arc i becomes its chord."""
    MERGE_LINE = 3
    """Both edges at vertex j become the line between their far ends."""
    MERGE_ARC = 4
    """Both edges at vertex j become the arc through their far ends and j."""
    CLOSE = 5
    """Edge i shrinks to its middle: its neighbours meet there."""
    ADD_LOOP = 6
    """A circle of four arcs, data = (x, y, radius), clockwise (a hole) if the radius is negative."""
    REMOVE_LOOP = 7
    """The loop of vertex i goes."""
    SPLIT_LINES = 8
    """Arc i into two lines through its apex."""
    PINCH = 9
    """Edges i and j, the two sides of a slit or of a thin wall, swap their ends, and the slit is gone.

    data = (j, p, q): whether the new edge from i's start to j's end, and the one from j's start to i's end, is a
    point."""

    ROUND = 10
    """A tangent arc between both edges at vertex i, which give way by as much."""
    CHAMFER = 11
    """A line between both edges at vertex i, which give way by as much."""
    SPLIT_THREE = 12
    """Arc i into three lines through the points at thirds of its sweep."""
    CIRCLE = 13
    """The loop of vertex i becomes a circle of two arcs, data = (x, y, radius), clockwise if the radius is negative."""


CUT = 6.0
"""How far (px) the edges at a vertex give way to a new one between them, at most."""
CUT_SHARE = 0.3
"""The same as a share of the edges."""
NEW_VERTICES = 4
"""The most vertices that one rewrite adds."""


@nb.njit(cache=True)
def rewrite(rule, site, data, x, y, b, arc, nxt, prv, n):
    """Apply one rewrite to arrays with room for n + 4 vertices; returns the new number of vertices in use.

    data: (3,) float64. prv: (n + 4,) int64, the vertex before each.
    """
    i = site
    j = nxt[i]
    if rule == Rule.PINCH:
        c = int(data[0])
        d = nxt[c]
        longer = i if math.hypot(x[j] - x[i], y[j] - y[i]) > math.hypot(x[d] - x[c], y[d] - y[c]) else c
        length = math.hypot(x[nxt[longer]] - x[longer], y[nxt[longer]] - y[longer])
        bulge, bent = b[longer], arc[longer]
        for start, end, point in ((i, d, data[1]), (c, j, data[2])):
            if point != 0.0:
                _join(start, end, x, y, nxt, prv)
            else:
                nxt[start], prv[end] = end, start
                arc[start] = bent
                b[start] = sub_bulge(bulge, min(1.0, math.hypot(x[end] - x[start], y[end] - y[start]) / length))
        return n
    if rule == Rule.ROUND or rule == Rule.CHAMFER:
        p = prv[i]
        first, second = arc_length(x[p], y[p], x[i], y[i], b[p]), arc_length(x[i], y[i], x[j], y[j], b[i])
        cut = min(CUT, CUT_SHARE * first, CUT_SHARE * second)
        kink = turn_at(x, y, b, p, i, j)
        before, after = 1.0 - cut / max(first, 1e-9), cut / max(second, 1e-9)
        x[n], y[n] = point_along(x[i], y[i], x[j], y[j], b[i], after)
        x[i], y[i] = point_along(x[p], y[p], x[i], y[i], b[p], before)
        b[p] = sub_bulge(b[p], before)
        arc[n], b[n] = arc[i], sub_bulge(b[i], 1.0 - after)
        arc[i] = rule == Rule.ROUND
        b[i] = math.tan(0.25 * kink) if arc[i] else 0.0
        nxt[n], prv[j] = j, n
        nxt[i], prv[n] = n, i
        return n + 1
    if rule == Rule.SPLIT_THREE:
        x[n], y[n] = point_along(x[i], y[i], x[j], y[j], b[i], 1.0 / 3.0)
        x[n + 1], y[n + 1] = point_along(x[i], y[i], x[j], y[j], b[i], 2.0 / 3.0)
        for e in (i, n, n + 1):
            arc[e], b[e] = False, 0.0
        nxt[i], nxt[n], nxt[n + 1] = n, n + 1, j
        prv[n], prv[n + 1], prv[j] = i, n, n + 1
        return n + 2
    if rule == Rule.SPLIT or rule == Rule.SPLIT_LINES:
        x[n], y[n] = apex(x[i], y[i], x[j], y[j], b[i])
        arc[n] = arc[i] and rule == Rule.SPLIT
        b[n] = sub_bulge(b[i], 0.5) if arc[n] else 0.0
        arc[i], b[i] = arc[n], b[n]
        nxt[n], prv[n] = j, i
        nxt[i], prv[j] = n, n
        return n + 1
    if rule == Rule.TO_ARC:
        arc[i], b[i] = True, 0.0
    elif rule == Rule.TO_LINE:
        arc[i], b[i] = False, 0.0
    elif rule == Rule.MERGE_LINE or rule == Rule.MERGE_ARC:
        before = prv[i]
        arc[before] = rule == Rule.MERGE_ARC
        b[before] = bulge_through(x[before], y[before], x[i], y[i], x[j], y[j]) if arc[before] else 0.0
        nxt[before], prv[j] = j, before
        _remove(i, x, y, nxt, prv)
    elif rule == Rule.CLOSE:
        x[i], y[i] = 0.5 * (x[i] + x[j]), 0.5 * (y[i] + y[j])
        arc[i], b[i] = arc[j], b[j]
        nxt[i], prv[nxt[j]] = nxt[j], i
        _remove(j, x, y, nxt, prv)
    elif rule == Rule.REMOVE_LOOP or rule == Rule.CIRCLE:
        while nxt[i] != i:
            after = nxt[i]
            _remove(i, x, y, nxt, prv)
            i = after
        if rule == Rule.CIRCLE:
            for k in range(2):
                x[n + k], y[n + k] = data[0] + (2.0 * k - 1.0) * abs(data[2]), data[1]
                b[n + k], arc[n + k] = 1.0 if data[2] > 0.0 else -1.0, True
                nxt[n + k], prv[n + k] = n + 1 - k, n + 1 - k
            return n + 2
    elif rule == Rule.ADD_LOOP:
        r = abs(data[2])
        turn = 1.0 if data[2] > 0.0 else -1.0
        for k in range(4):
            angle = turn * 0.5 * math.pi * k
            x[n + k], y[n + k] = data[0] + r * math.cos(angle), data[1] + r * math.sin(angle)
            b[n + k], arc[n + k] = turn * math.tan(math.pi / 8.0), True
            nxt[n + k], prv[n + k] = n + (k + 1) % 4, n + (k + 3) % 4
        return n + 4
    return n


@nb.njit(cache=True)
def _join(end, start, x, y, nxt, prv):
    """Let what comes in at ``end`` go out at ``start``, in the middle of both; an edge from start to end goes too."""
    before = prv[end]
    x[start], y[start] = 0.5 * (x[start] + x[end]), 0.5 * (y[start] + y[end])
    _remove(end, x, y, nxt, prv)
    if before == start:
        _remove(start, x, y, nxt, prv)
    else:
        nxt[before], prv[start] = start, before


@nb.njit(cache=True, inline="always")
def _remove(i, x, y, nxt, prv):
    """Leave vertex i pointing at itself, far below every canvas, where no kernel meets it."""
    nxt[i], prv[i] = i, i
    x[i], y[i] = -1e7, -1e7


@nb.njit(cache=True)
def touched(rule, site, data, nxt, prv, n, vertices, edges):
    """What a rewrite touches, asked *before* it is applied.

    Fills ``vertices`` (4,) with the ends of the edges that it makes or changes (-1: none), those whose places a trial
    may tune first, and ``edges`` (4,) with these edges. Returns how many vertices are tunable, and how many edges there
    are. Far ends stay put in a trial, which keeps its window small; a merge moves them, having nothing else to give
    way.
    """
    i, j = site, nxt[site]
    vertices[:] = -1
    if rule == Rule.ADD_LOOP:
        for k in range(4):
            vertices[k] = edges[k] = n + k
        return 4, 4
    if rule == Rule.ROUND or rule == Rule.CHAMFER:
        vertices[0], vertices[1], vertices[2], vertices[3] = i, n, prv[i], j
        edges[0], edges[1], edges[2] = i, n, prv[i]
        return 2, 3
    if rule == Rule.SPLIT_THREE:
        vertices[0], vertices[1], vertices[2], vertices[3] = n, n + 1, i, j
        edges[0], edges[1], edges[2] = i, n, n + 1
        return 2, 3
    if rule == Rule.CIRCLE:
        for k in range(2):
            vertices[k] = edges[k] = n + k
        return 2, 2
    if rule == Rule.SPLIT or rule == Rule.SPLIT_LINES:
        vertices[0], vertices[1], vertices[2] = n, i, j
        edges[0], edges[1] = i, n
        return 1, 2
    if rule == Rule.TO_ARC or rule == Rule.TO_LINE:
        vertices[0], vertices[1] = i, j
        edges[0] = i
        return (2 if rule == Rule.TO_LINE else 0), 1
    if rule == Rule.MERGE_LINE or rule == Rule.MERGE_ARC:
        vertices[0], vertices[1] = prv[i], j
        edges[0] = prv[i]
        return 2, 1
    if rule == Rule.CLOSE:
        vertices[0], vertices[1], vertices[2] = i, prv[i], nxt[j]
        edges[0], edges[1] = prv[i], i
        return 1, 2
    if rule == Rule.PINCH:
        c = int(data[0])
        d = nxt[c]
        # A tip of one edge vanishes with its slit.
        free, own = 0, 0
        for start, end, point in ((i, d, data[1]), (c, j, data[2])):
            if point == 0.0:
                vertices[free], vertices[free + 1] = start, end
                edges[own] = start
                free += 2
                own += 1
            elif prv[start] != end:
                vertices[free] = end
                free += 1
        return free, own
    return 0, 0


@nb.njit(cache=True)
def candidates(x, y, b, arc, nxt, prv, sizes, lossy):
    """Rewrites of edges and vertices that their guards allow, all but those of whole loops.

    x, y, b, arc, nxt, prv: (n,) linked loops in pixels; sizes: (n,) the number of edges of each vertex' loop; lossy:
    how far (px) a merge may move the outline. Returns rules, sites (k,) and touched (k, 4), the vertices that each
    touches (-1: none).
    """
    n = x.shape[0]
    rules, sites = np.empty(9 * n, np.int64), np.empty(9 * n, np.int64)
    marks = np.empty((9 * n, 4), np.int64)
    edges = np.empty(4, np.int64)
    vertices = np.empty(4, np.int64)
    data = np.zeros(3)
    k = 0
    for i in range(n):
        j, p = nxt[i], prv[i]
        for rule in (
            Rule.SPLIT,
            Rule.SPLIT_LINES,
            Rule.TO_LINE,
            Rule.TO_ARC,
            Rule.MERGE_LINE,
            Rule.MERGE_ARC,
            Rule.CLOSE,
            Rule.ROUND,
            Rule.CHAMFER,
            Rule.SPLIT_THREE,
        ):
            if (rule == Rule.SPLIT_LINES or rule == Rule.TO_LINE or rule == Rule.SPLIT_THREE) and not arc[i]:
                continue
            if rule == Rule.TO_ARC and arc[i]:
                continue
            if sizes[i] <= 2 and (rule == Rule.MERGE_LINE or rule == Rule.MERGE_ARC or rule == Rule.CLOSE):
                continue
            if rule == Rule.TO_LINE and abs(b[i]) * math.hypot(x[j] - x[i], y[j] - y[i]) > 2.0 * lossy:
                continue
            if rule == Rule.MERGE_LINE and not _near_line(x, y, b, p, i, j, lossy):
                continue
            if rule == Rule.MERGE_ARC and not _near_arc(x, y, b, p, i, j, lossy):
                continue
            if rule == Rule.CLOSE and math.hypot(x[j] - x[i], y[j] - y[i]) > lossy:
                continue
            touched(rule, i, data, nxt, prv, n, vertices, edges)
            rules[k], sites[k] = rule, i
            marks[k] = vertices
            k += 1
    return rules[:k], sites[:k], marks[:k]


@nb.njit(cache=True)
def _near_line(x, y, b, p, i, j, lossy):
    """Whether the line p-j stays near both edges at vertex i: the triangle's least height and the edges' sagittas.

    The least height, not the distance to the line, so that a spike folded back on itself counts as near.
    """
    first, second = math.hypot(x[i] - x[p], y[i] - y[p]), math.hypot(x[j] - x[i], y[j] - y[i])
    if 0.5 * max(abs(b[p]) * first, abs(b[i]) * second) > lossy:
        return False
    longest = max(first, second, math.hypot(x[j] - x[p], y[j] - y[p]))
    area2 = abs((x[i] - x[p]) * (y[j] - y[p]) - (x[j] - x[p]) * (y[i] - y[p]))
    return area2 <= lossy * longest


@nb.njit(cache=True)
def _near_arc(x, y, b, p, i, j, lossy):
    """Whether the arc through p, i and j stays near both edges: between the vertices, their apexes against its own."""
    whole = bulge_through(x[p], y[p], x[i], y[i], x[j], y[j])
    first, second = math.hypot(x[i] - x[p], y[i] - y[p]), math.hypot(x[j] - x[i], y[j] - y[i])
    if first + second == 0.0:
        return True
    # Sub-arcs of the whole circle over both chords: half sweeps h with r sin(h) = chord / 2.
    chord = math.hypot(x[j] - x[p], y[j] - y[p])
    if abs(whole) < 1e-9:
        return 0.5 * max(abs(b[p]) * first, abs(b[i]) * second) <= lossy
    r = max(chord * (1.0 + whole * whole) / (4.0 * abs(whole)), 0.5 * first, 0.5 * second)
    sign = 1.0 if whole > 0.0 else -1.0
    for c, bulge in ((first, b[p]), (second, b[i])):
        minor = sign * math.tan(0.5 * math.asin(min(1.0, 0.5 * c / r)))
        if (
            0.5 * c * abs(bulge - minor) > lossy
            and 0.5 * c * abs(bulge - (1.0 / minor if minor != 0.0 else 0.0)) > lossy
        ):
            return False
    return True
