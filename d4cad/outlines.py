"""The closed curves of which :mod:`d4cad.shapes` makes plates, holes and islands, and the cuts in their edges.

Every outline is made about the origin at a size, half of its longer side, by a random generator.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin, tan
from typing import NamedTuple

import numpy as np

from d4cad.edges import Complexes, Edges, Floats

Random = np.random.Generator


class Curve(NamedTuple):
    """A closed curve: ``z`` (n,) vertices x + iy, ``b`` (n,) the bulges of the edges that leave them.

    It runs counter-clockwise whatever it will bound.
    """

    z: Complexes
    b: Floats

    @property
    def edges(self) -> Edges:
        """The n edges; edge i ends at vertex i + 1."""
        return Edges(self.z, np.roll(self.z, -1), self.b)

    def placed(self, at: complex, angle: float) -> Curve:
        """Turned about the origin by ``angle`` radians, then moved by ``at``."""
        return Curve(np.asarray(self.z * np.exp(1j * angle) + at), self.b)

    def with_vertex_replaced(self, i: int, z: list[complex], b: list[float]) -> Curve:
        """Vertex i and the edge that leaves it, replaced by vertices ``z`` and the edges that leave them."""
        return Curve(np.concatenate([self.z[:i], z, self.z[i + 1 :]]), np.concatenate([self.b[:i], b, self.b[i + 1 :]]))


def _curve(z: list[complex], b: list[float] | None = None) -> Curve:
    return Curve(np.array(z, dtype=np.complex128), np.array(b if b else [0.0] * len(z), dtype=np.float64))


def disc(rng: Random, size: float) -> Curve:
    """A full circle: two semicircles."""
    start = size * np.exp(1j * rng.uniform(0, 2 * pi))
    return _curve([start, -start], [1.0, 1.0])


def rectangle(rng: Random, size: float) -> Curve:
    """2 size wide, between 0.45 and 1 of that high."""
    h = size * rng.uniform(0.45, 1.0)
    return _curve([-size - 1j * h, size - 1j * h, size + 1j * h, -size + 1j * h])


def slot(rng: Random, size: float) -> Curve:
    """Two lines and two semicircles."""
    r = size * rng.uniform(0.3, 0.65)
    x = size - r
    return _curve([-x - 1j * r, x - 1j * r, x + 1j * r, -x + 1j * r], [0.0, 1.0, 0.0, 1.0])


def round_ended(rng: Random, size: float) -> Curve:
    """Three lines and a semicircle."""
    r = size * rng.uniform(0.4, 0.9)
    x = max(size - r, 0.1 * size)
    return _curve([-x - 1j * r, x - 1j * r, x + 1j * r, -x + 1j * r], [0.0, 1.0, 0.0, 0.0])


def polygon(rng: Random, size: float) -> Curve:
    """Three to seven corners on a circle, half of the time evenly."""
    n = int(rng.integers(3, 8))
    jitter = rng.uniform(-0.22, 0.22, n) if rng.random() < 0.5 else np.zeros(n)
    return _curve(list(size * np.exp(2j * pi * (np.arange(n) + jitter) / n)))


def bowed(rng: Random, size: float) -> Curve:
    """Three to six corners joined by arcs and lines."""
    n = int(rng.integers(3, 7))
    bulges = rng.choice([0.0, 1.0, -1.0], n, p=[0.4, 0.4, 0.2]) * rng.uniform(0.15, 0.6, n)
    return _curve(list(size * np.exp(2j * pi * np.arange(n) / n)), list(bulges))


def dee(rng: Random, size: float) -> Curve:
    """A circle cut off by a chord."""
    sweep = rng.uniform(0.9, 1.6) * pi
    half = sweep / 2
    return _curve([size * np.exp(-1j * half), size * np.exp(1j * half)], [tan(sweep / 4), 0.0])


def ring_sector(rng: Random, size: float) -> Curve:
    """Part of a ring: two arcs about one centre and two lines towards it."""
    half = rng.uniform(0.5, 1.2)
    outer = size / max(sin(half), 0.6)
    inner = outer * rng.uniform(0.4, 0.7)
    a, bulge = np.exp(1j * half), tan(half / 2)
    middle = (outer + inner * cos(half)) / 2
    ring = [outer / a, outer * a, inner * a, inner / a]
    return _curve([z - middle for z in ring], [bulge, 0.0, -bulge, 0.0])


def curved_slot(rng: Random, size: float) -> Curve:
    """Part of a ring with semicircular ends: four arcs."""
    half = rng.uniform(0.5, 1.1)
    middle = size / max(sin(half), 0.6)
    r = middle * min(rng.uniform(0.15, 0.3), 0.6 * half)
    a, bulge = np.exp(1j * half), tan(half / 2)
    ring = [(middle + r) / a, (middle + r) * a, (middle - r) * a, (middle - r) / a]
    return _curve([z - middle for z in ring], [bulge, 1.0, -bulge, 1.0])


def ell(rng: Random, size: float) -> Curve:
    """An L."""
    s, h = size, size * rng.uniform(0.7, 1.0)
    x, y = rng.uniform(0.5, 1.0, 2) * size
    return _curve([-s - 1j * h, s - 1j * h, s + 1j * (y - h), x - s + 1j * (y - h), x - s + 1j * h, -s + 1j * h])


def tee(rng: Random, size: float) -> Curve:
    """A T."""
    s, h, y = size, size * rng.uniform(0.7, 1.0), size * rng.uniform(0.4, 0.8)
    left, right = -s * rng.uniform(0.2, 0.6), s * rng.uniform(0.2, 0.6)
    top = h - y
    bar = [s + 1j * top, s + 1j * h, -s + 1j * h, -s + 1j * top]
    return _curve([left - 1j * h, right - 1j * h, right + 1j * top, *bar, left + 1j * top])


def channel(rng: Random, size: float) -> Curve:
    """A U."""
    s, h = size, size * rng.uniform(0.6, 1.0)
    left, right, y = -s * rng.uniform(0.3, 0.6), s * rng.uniform(0.3, 0.6), -h * rng.uniform(0.0, 0.6)
    gap = [right + 1j * h, right + 1j * y, left + 1j * y, left + 1j * h]
    return _curve([-s - 1j * h, s - 1j * h, s + 1j * h, *gap, -s + 1j * h])


def gear(rng: Random, size: float) -> Curve:
    """Teeth of straight flanks on a circle, their tips flat."""
    teeth = int(rng.integers(5, 13))
    root = size * rng.uniform(0.72, 0.85)
    pitch = 2 * pi / teeth
    gap, flank = pitch * rng.uniform(0.3, 0.4), pitch * rng.uniform(0.04, 0.12)
    bounds = np.array([0.0, gap, gap + flank, pitch - flank])
    radii = np.array([root, root, size, size])
    angles = np.arange(teeth)[:, None] * pitch + bounds[None, :]
    return _curve(list((radii * np.exp(1j * angles)).ravel()))


def knob(rng: Random, size: float) -> Curve:
    """Arcs and lines by turns around a circle: round gullets or round lobes."""
    lobes = int(rng.integers(3, 10))
    pitch = 2 * pi / lobes
    width = pitch * rng.uniform(0.4, 0.6)
    angles = (np.arange(lobes)[:, None] * pitch + np.array([0.0, width])[None, :]).ravel()
    bulge = rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 0.9)
    radius = size if bulge < 0 else size / (1 + bulge * sin(width / 2))
    return _curve(list(radius * np.exp(1j * angles)), [bulge, 0.0] * lobes)


Outline = Callable[[Random, float], Curve]

PLATES: tuple[Outline, ...] = (
    rectangle, rectangle, polygon, disc, slot, round_ended, dee, ring_sector, bowed, ell, tee, channel, gear, knob,
)  # fmt: skip
OPENINGS: tuple[Outline, ...] = (
    disc, disc, disc, slot, slot, rectangle, polygon, polygon, dee, round_ended, curved_slot, ring_sector, bowed, ell,
)  # fmt: skip


def fillet(rng: Random, curve: Curve, i: int) -> Curve:
    """Vertex i between two lines rounded by a tangent arc."""
    room, turn, before, after = _corner(curve, i)
    cut = room * rng.uniform(0.15, 0.9)
    return curve.with_vertex_replaced(i, [curve.z[i] - cut * before, curve.z[i] + cut * after], [tan(turn / 4), 0.0])


def chamfer(rng: Random, curve: Curve, i: int) -> Curve:
    """Vertex i between two lines cut off by a line."""
    room, _, before, after = _corner(curve, i)
    cut, other = room * rng.uniform(0.15, 0.8, 2)
    if rng.random() < 0.6:
        other = cut
    return curve.with_vertex_replaced(i, [curve.z[i] - cut * before, curve.z[i] + other * after], [0.0, 0.0])


def _corner(curve: Curve, i: int) -> tuple[float, float, complex, complex]:
    """The shorter edge at vertex i, the turn in radians, and the directions before and after."""
    n = curve.z.size
    before, after = curve.z[i] - curve.z[i - 1], curve.z[(i + 1) % n] - curve.z[i]
    turn = float(np.angle(after / before))
    return min(abs(before), abs(after)), turn, before / abs(before), after / abs(after)


def _notched(
    curve: Curve, i: int, rng: Random, shape: Callable[[float, float], tuple[list[complex], list[float]]]
) -> Curve:
    """Line i interrupted by ``shape(width, depth)``, drawn from 0 to width with depth to the left."""
    start, end = curve.z[i], curve.z[(i + 1) % curve.z.size]
    length = abs(end - start)
    along = (end - start) / length
    width = length * 0.7 * (min(0.1 / length, 1.0)) ** rng.uniform(0, 1)  # small ones as often as large ones
    width = min(width, 0.5)
    at = rng.choice([0.5, rng.uniform(0.2, 0.8)]) * (length - width)
    depth = rng.choice([1.0, -1.0], p=[0.65, 0.35]) * width * rng.uniform(0.4, 1.6)
    z, b = shape(width, depth)
    points = [start + along * (at + p) for p in z]
    return curve.with_vertex_replaced(i, [start, *points], [0.0, *b])


def square_notch(rng: Random, curve: Curve, i: int) -> Curve:
    """A rectangular notch or tab in line i."""
    return _notched(curve, i, rng, lambda w, d: ([0, 1j * d, w + 1j * d, w], [0.0] * 4))


def vee_notch(rng: Random, curve: Curve, i: int) -> Curve:
    """A triangular notch or tab in line i."""
    return _notched(curve, i, rng, lambda w, d: ([0, w / 2 + 1j * d, w], [0.0] * 3))


def round_notch(rng: Random, curve: Curve, i: int) -> Curve:
    """A circular notch or tab in line i."""
    return _notched(curve, i, rng, lambda w, d: ([0, w], [-float(np.clip(d / w, -1.0, 1.0)), 0.0]))


def slot_notch(rng: Random, curve: Curve, i: int) -> Curve:
    """A notch or tab with a semicircular end in line i."""
    return _notched(curve, i, rng, lambda w, d: ([0, 1j * d, w + 1j * d, w], [0.0, -float(np.sign(d)), 0.0, 0.0]))
