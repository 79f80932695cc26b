"""The rewrites of the Union-Rect grammar: each takes some rectangles away and puts others in their place.

Where a rewrite cuts a rectangle, the pieces lap over each other: the union is the same, and a small move of one of them
opens no slit. Rectangles are (n, 5) arrays in world units: centre, half-sizes, angle.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from d4cad.grammars.union_rect.structure import corners, from_local, part, to_local
from d4cad.program import Floats

THIN = 1e-9
"""Pieces with a half-size under this (world units) are rounding."""


class Exchange(NamedTuple):
    """What a rewrite does: the numbers of the rectangles that go, and those that come, (k, 5)."""

    gone: tuple[int, ...]
    new: Floats


def split(rects: Floats, i: int, axis: int, share: float, lap: float) -> Exchange:
    """Rectangle i in two, cut across its local x (axis 0) or y (1) at ``share`` of its extent.

    Each piece reaches past the cut by half of ``lap``, where the rectangle is that long.
    """
    hx, hy = rects[i, 2:4]
    half = hx if axis == 0 else hy
    at = (2 * share - 1) * half
    before, after = min(at + lap / 2, half), max(at - lap / 2, -half)
    if axis == 0:
        pieces = [part(rects[i], -hx, before, -hy, hy), part(rects[i], after, hx, -hy, hy)]
    else:
        pieces = [part(rects[i], -hx, hx, -hy, before), part(rects[i], -hx, hx, after, hy)]
    return Exchange((i,), np.array(pieces))


def hole(rects: Floats, box: Floats) -> Exchange:
    """Every rectangle that the box (5,) reaches, cut open: at most four pieces of each remain around it.

    A rectangle at the box's angle loses exactly the box, any other one the box's bounds in its own frame. The pieces
    left and right of the cut and those below and above it lap over each other in the corners.
    """
    gone, pieces = [], []
    for i in reached(rects, box):
        local = to_local(rects[i], corners(box[None])[0])
        (u0, v0), (u1, v1) = local.min(axis=0), local.max(axis=0)
        hx, hy = rects[i, 2:4]
        gone.append(i)
        if u0 > -hx + THIN:
            pieces.append(part(rects[i], -hx, u0, -hy, hy))
        if u1 < hx - THIN:
            pieces.append(part(rects[i], u1, hx, -hy, hy))
        if v0 > -hy + THIN:
            pieces.append(part(rects[i], -hx, hx, -hy, v0))
        if v1 < hy - THIN:
            pieces.append(part(rects[i], -hx, hx, v1, hy))
    return Exchange(tuple(gone), np.array(pieces).reshape(-1, 5))


def reached(rects: Floats, box: Floats) -> list[int]:
    """The rectangles whose inside meets the inside of a box (5,): no axis of either separates them."""
    found = []
    own, edge = corners(rects), corners(box[None])[0]
    apart = np.hypot(rects[:, 0] - box[0], rects[:, 1] - box[1])
    near = apart < np.hypot(rects[:, 2], rects[:, 3]) + np.hypot(box[2], box[3])
    for i in np.flatnonzero(near).tolist():
        bounds = ((rects[i], edge), (box, own[i]))
        if all(
            to_local(a, b)[:, k].max() > -a[2 + k] + THIN and to_local(a, b)[:, k].min() < a[2 + k] - THIN
            for a, b in bounds
            for k in range(2)
        ):
            found.append(i)
    return found


def add(box: Floats) -> Exchange:
    """A new rectangle (5,)."""
    return Exchange((), box[None].copy())


def remove(rects: Floats, i: int) -> Exchange:
    """Rectangle i goes."""
    return Exchange((i,), np.empty((0, 5)))


def merge(rects: Floats, i: int, j: int) -> Exchange:
    """Two rectangles become the smallest box around both at one of 18 angles: those of both rectangles, and the 16
    directions from a corner of j to a corner of i."""
    both = rects[[i, j]]
    p, q = corners(both)
    ways = (p[:, None] - q[None]).reshape(-1, 2)
    angles = np.concatenate([both[:, 4], np.arctan2(ways[:, 1], ways[:, 0])])
    points = np.concatenate([p, q])
    cos, sin = np.cos(angles)[:, None], np.sin(angles)[:, None]
    u, v = points[:, 0] * cos + points[:, 1] * sin, points[:, 1] * cos - points[:, 0] * sin
    half = np.stack([np.ptp(u, axis=1), np.ptp(v, axis=1)], axis=1) / 2
    area = half.prod(axis=1)
    k = int(np.argmin(area > area.min() + THIN))  # the first of equals: the rectangles' own angles
    middle = np.array([0.0, 0.0, 0.0, 0.0, angles[k]])
    x, y = from_local(middle, (u[k].max() + u[k].min()) / 2, (v[k].max() + v[k].min()) / 2)
    return Exchange((i, j), np.array([[x, y, *half[k], angles[k]]]))


def merge_gain(rects: Floats, i: int, j: int) -> float:
    """What a merge adds, as a product of half-sizes: that of the box less those of both rectangles (SPEC 4.1)."""
    box = merge(rects, i, j).new[0]
    return float(box[2] * box[3] - rects[i, 2] * rects[i, 3] - rects[j, 2] * rects[j, 3])


def near(rects: Floats, reach: float) -> list[tuple[int, int]]:
    """Pairs whose circumscribed circles touch, made ``reach`` times as large."""
    radius = np.hypot(rects[:, 2], rects[:, 3])
    apart = np.hypot(rects[:, None, 0] - rects[None, :, 0], rects[:, None, 1] - rects[None, :, 1])
    i, j = np.nonzero(np.triu(apart <= reach * (radius[:, None] + radius[None, :]), 1))
    return list(zip(i.tolist(), j.tolist(), strict=True))
