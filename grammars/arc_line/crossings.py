"""Where edges meet, compiled. All in pixels; an edge is one row of the scan kernel's table."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

from d4cad.raster.pieces import BULGE, CX, FLAT, LENGTH, RADIUS, SX, X0, Y0, distance

TOUCH = 1e-6
"""What comes this near (px) to an edge lies on it: far above the rounding of a crossing, far below what matters."""
SNAP = 1e-4
"""Crossings and vertices this near (px) to each other are one node; so near to a shared vertex edges do not cross."""

FLATTEST = 1e-9
"""Arcs of a lesser bulge are as good as lines, and quotients of their angles would be rounding."""


@nb.njit(cache=True)
def boxes(owner, ends, pieces, n):
    """True bounding boxes of the edges, (n, 4): low x, low y, high x, high y, from their monotone pieces."""
    box = np.empty((n, 4))
    box[:, 0:2] = np.inf
    box[:, 2:4] = -np.inf
    for k in range(pieces):
        e = owner[k]
        for i in range(2):
            box[e, i] = min(box[e, i], ends[k, i], ends[k, i + 2])
            box[e, i + 2] = max(box[e, i + 2], ends[k, i], ends[k, i + 2])
    return box


@nb.njit(cache=True)
def share(table, e, px, py):
    """How far along the edge a point of it lies, as a share of its length (of its sweep): 0 at the start, 1 at the end.

    By what is well-conditioned: the distance from the nearer end, which is L sin(share h) / sin(h) for half the sweep
    h, and on arcs over half a turn the angle under which the other end sees that distance, share h.
    """
    dx, dy = px - table[e, X0], py - table[e, Y0]
    u = dx * table[e, CX] + dy * table[e, SX]
    v = dx * table[e, SX] - dy * table[e, CX]
    b, length = table[e, BULGE], table[e, LENGTH]
    half = 2.0 * math.atan(b)
    late = u + u > length
    if abs(b) > 1.0:
        part = math.atan2(v, u if late else length - u) / half
    else:
        part = math.hypot(length - u if late else u, v) / length
        if abs(b) > FLATTEST:
            part = math.asin(part * math.sin(half)) / half
    return 1.0 - part if late else part


@nb.njit(cache=True)
def gap(table, e, px, py):
    """Distance of a point from an edge."""
    dx, dy = px - table[e, X0], py - table[e, Y0]
    u = dx * table[e, CX] + dy * table[e, SX]
    v = dx * table[e, SX] - dy * table[e, CX]
    b = table[e, BULGE]
    cos, sin = (1.0 - b * b) / (1.0 + b * b), 2.0 * b / (1.0 + b * b)
    return abs(distance(u, v, table[e, LENGTH], b, cos, sin, table[e, RADIUS], table[e, FLAT])[0])


@nb.njit(cache=True, inline="always")
def _implicit(table, e):
    """The edge's curve as k (x^2 + y^2) + 2 gx x + 2 gy y + h = 0 about its own start (h = 0)."""
    b, length = table[e, BULGE], table[e, LENGTH]
    gx = table[e, FLAT] * table[e, SX] - b * length * table[e, CX]
    gy = -table[e, FLAT] * table[e, CX] - b * length * table[e, SX]
    return 2.0 * b, gx, gy


@nb.njit(cache=True)
def meet(table, i, j, points):
    """Intersections of the whole curves (lines or circles) of edges i and j; fills ``points`` (2, 2), returns how many.

    The radical line of both circles meets the more curved one of them. Where it passes by, the one point is where the
    curves are nearest, so that a tangency lost to rounding is still looked at.
    """
    if abs(table[i, BULGE]) * table[j, LENGTH] < abs(table[j, BULGE]) * table[i, LENGTH]:
        i, j = j, i
    # Coordinates about the start of i. Curve i: k p.p + 2 g.p = 0; curve j moved there gains a constant.
    k, gx, gy = _implicit(table, i)
    kj, jx, jy = _implicit(table, j)
    ox, oy = table[j, X0] - table[i, X0], table[j, Y0] - table[i, Y0]
    hj = kj * (ox * ox + oy * oy) - 2.0 * (jx * ox + jy * oy)
    jx -= kj * ox
    jy -= kj * oy
    # Radical line a.p = c: curve j minus ratio times curve i.
    ratio = kj / k if k != 0.0 else 0.0
    ax, ay, c = 2.0 * (jx - ratio * gx), 2.0 * (jy - ratio * gy), -hj
    size2 = ax * ax + ay * ay
    if size2 <= 1e-24 * (table[i, RADIUS] ** 2 + table[j, RADIUS] ** 2):
        return 0
    qx, qy = ax * c / size2, ay * c / size2
    dx, dy = -ay / math.sqrt(size2), ax / math.sqrt(size2)
    # On p = q + s d: k s^2 + 2 (k q.d + g.d) s + (k q.q + 2 g.q) = 0.
    half = k * (qx * dx + qy * dy) + gx * dx + gy * dy
    rest = k * (qx * qx + qy * qy) + 2.0 * (gx * qx + gy * qy)
    root = math.sqrt(max(half * half - k * rest, 0.0))
    big = -(half + root) if half >= 0.0 else root - half
    count = 0
    for r in range(2):
        above, below = (rest, big) if r == 0 else (big, k)
        if abs(below) * 1e12 * (table[i, LENGTH] + table[j, LENGTH]) <= abs(above):
            continue  # so far away that only parallel lines meet there
        s = above / below if below != 0.0 else 0.0
        points[count, 0] = table[i, X0] + qx + s * dx
        points[count, 1] = table[i, Y0] + qy + s * dy
        count += 1
        if root == 0.0:
            break
    return count


@nb.njit(cache=True)
def near_pairs(box, margin):
    """Pairs i < j of boxes (n, 4) that come within ``margin`` of each other, (k, 2)."""
    n = box.shape[0]
    pairs = np.empty((n * (n - 1) // 2, 2), np.int64)
    count = 0
    for i in range(n):
        low_x, low_y, high_x, high_y = box[i, 0] - margin, box[i, 1] - margin, box[i, 2] + margin, box[i, 3] + margin
        for j in range(i + 1, n):
            if low_x <= box[j, 2] and box[j, 0] <= high_x and low_y <= box[j, 3] and box[j, 1] <= high_y:
                pairs[count, 0], pairs[count, 1] = i, j
                count += 1
    return pairs[:count]


@nb.njit(cache=True)
def root_of(parent, i):
    """The representative of node i among those that are one with it."""
    while parent[i] != i:
        i = parent[i]
    return i


@nb.njit(cache=True, inline="always")
def _unite(parent, met, i, j):
    i, j = root_of(parent, i), root_of(parent, j)
    parent[max(i, j)] = min(i, j)
    met[i] = met[j] = True


@nb.njit(cache=True, inline="always")
def _end_at(x, y, nxt, e, px, py):
    """The vertex of edge e that is one with a point, or -1."""
    if math.hypot(px - x[e], py - y[e]) <= SNAP:
        return e
    return nxt[e] if math.hypot(px - x[nxt[e]], py - y[nxt[e]]) <= SNAP else -1


@nb.njit(cache=True, inline="always")
def _node_at(x, y, px, py, qx, qy):
    """The first vertex or further node that is one with a point, else the number of a new node."""
    n = x.shape[0]
    for v in range(n):
        if abs(x[v] - qx) <= SNAP and abs(y[v] - qy) <= SNAP:
            return v
    for k in range(px.shape[0]):
        if abs(px[k] - qx) <= SNAP and abs(py[k] - qy) <= SNAP:
            return n + k
    return n + px.shape[0]


@nb.njit(cache=True)
def meetings(table, x, y, nxt, box):
    """Where edges meet other than in the vertices they share: crossings, tangencies, vertices on edges or on vertices.

    Returns (edge, at, node, px, py, parent, met). Cuts (k,): the edge, the share of it, the node there. Nodes: the n
    vertices, then the points (px, py); parent (nodes,) leads to the node that each is one with, met (nodes,) says
    whether anything meets there.
    """
    n = x.shape[0]
    pairs = near_pairs(box, TOUCH)
    edge = np.empty(6 * pairs.shape[0], np.int64)
    at = np.empty(6 * pairs.shape[0])
    node = np.empty(6 * pairs.shape[0], np.int64)
    parent = np.arange(n + 2 * pairs.shape[0])
    met = np.zeros(n + 2 * pairs.shape[0], np.bool_)
    px, py = np.empty(2 * pairs.shape[0]), np.empty(2 * pairs.shape[0])
    points = np.empty((2, 2))
    cuts = fresh = 0
    for pair in range(pairs.shape[0]):
        i, j = pairs[pair, 0], pairs[pair, 1]
        if nxt[i] == j and nxt[j] == i and abs(table[i, BULGE] + table[j, BULGE]) * table[i, LENGTH] <= TOUCH:
            met[i] = met[j] = True  # a loop of one curve there and back
        for side in range(2):
            v, e = (i, j) if side == 0 else (j, i)
            if v == nxt[e] or gap(table, e, x[v], y[v]) > TOUCH:
                continue
            if e == nxt[v]:
                met[e] = True  # the tip of a spike
            if v == nxt[nxt[e]]:
                met[nxt[e]] = True
            end = _end_at(x, y, nxt, e, x[v], y[v])
            if end >= 0:
                _unite(parent, met, v, end)
            else:
                edge[cuts], at[cuts], node[cuts] = e, share(table, e, x[v], y[v]), v
                cuts += 1
        for r in range(meet(table, i, j, points)):
            qx, qy = points[r, 0], points[r, 1]
            if nxt[i] == j and math.hypot(qx - x[j], qy - y[j]) <= SNAP:
                continue
            if nxt[j] == i and math.hypot(qx - x[i], qy - y[i]) <= SNAP:
                continue
            if gap(table, i, qx, qy) > TOUCH or gap(table, j, qx, qy) > TOUCH:
                continue
            if nxt[i] == j or nxt[j] == i:
                met[j if nxt[i] == j else i] = True
            end_i, end_j = _end_at(x, y, nxt, i, qx, qy), _end_at(x, y, nxt, j, qx, qy)
            if end_i >= 0 and end_j >= 0:
                _unite(parent, met, end_i, end_j)
                continue
            here = max(end_i, end_j)
            if here < 0:
                here = _node_at(x, y, px[:fresh], py[:fresh], qx, qy)
                if here == n + fresh:
                    px[fresh], py[fresh] = qx, qy
                    fresh += 1
            for e, end in ((i, end_i), (j, end_j)):
                if end < 0:
                    edge[cuts], at[cuts], node[cuts] = e, share(table, e, qx, qy), here
                    cuts += 1
    for k in range(cuts):
        met[root_of(parent, node[k])] = True
    nodes = n + fresh
    return edge[:cuts], at[:cuts], node[:cuts], px[:fresh], py[:fresh], parent[:nodes], met[:nodes]
