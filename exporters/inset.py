"""Outlines moved inwards edge by edge, corners kept sharp: the sections of drafted walls, chamfers and fillets."""

from __future__ import annotations

import numpy as np

from d4cad.edges import Complexes, Edges, chords, circle_distances
from d4cad.errors import GeometryError
from d4cad.loop import Loop
from d4cad.sketch import Face, Sketch

STEPS = 30
"""Newton steps to a corner; two suffice where its edges are straight, a near tangency halves its error in each."""


def inset(sketch: Sketch, distance: float) -> Sketch:
    """The sketch with every edge moved by ``distance`` (its own unit) into the material, or out of it if negative.

    Every edge lives on: lines stay parallel, arcs concentric, and neighbours are prolonged or cut where they meet.
    Raises GeometryError, saying where, if an edge would vanish or the moved outline would meet itself.
    """
    found = [moved(loop, distance) for loop in sketch.loops]
    nested = Sketch.from_loops(found, sketch.unit)
    if {*nested.loops} != {*found} or len(nested.faces) != len(sketch.faces):
        raise GeometryError(f"two outlines pass through each other when moved by {distance:g}")
    rest = iter(found)
    return Sketch(tuple(Face(next(rest), tuple(next(rest) for _ in face.holes)) for face in sketch.faces), sketch.unit)


def moved(loop: Loop, distance: float) -> Loop:
    """One loop with every edge moved to its left by ``distance``; see :func:`inset`. Crossings are not looked for."""
    if distance == 0:
        return loop
    e = loop.edges
    sweep = 4 * np.arctan(e.b)
    corners = _corners(e, distance)
    start, end = corners, np.roll(corners, -1)
    turn = np.angle(normals(e, end) / normals(e, start))
    turn += 2 * np.pi * np.round((sweep - turn) / (2 * np.pi))
    turn[e.b == 0] = 0.0
    curvature = 4 * e.b / (chords(e) * (1 + e.b**2))  # > 0 where the centre lies to the left
    backwards = ((end - start) * np.conj(e.z1 - e.z0)).real <= 0
    gone = np.where(e.b == 0, backwards, (turn * e.b <= 0) | (curvature * distance >= 1))
    if np.any(gone):
        i = int(np.argmax(gone))
        middle = (e.z0[i] + e.z1[i]) / 2
        raise GeometryError(f"the edge at ({middle.real:g}, {middle.imag:g}) vanishes when moved by {distance:g}")
    return Loop.from_arrays(np.stack([corners.real, corners.imag], axis=1), np.tan(turn / 4))


def normals(e: Edges, q: Complexes) -> Complexes:
    """Unit normals of the edges' circles at q, to the right of travel."""
    angle = 2 * np.arctan(e.b)
    gradient = 2 * np.sin(angle) * (q - (e.z0 + e.z1) / 2) - 1j * (e.z1 - e.z0) * np.cos(angle)
    return np.asarray(gradient / np.abs(gradient))


def _corners(e: Edges, distance: float) -> Complexes:
    """Where edge i - 1 and edge i meet when both are moved to their left.

    Newton's method on the two signed distances. Where the edges are tangent their normals agree and the step along
    them is right for both.
    """
    before = e.take(np.roll(np.arange(e.b.size), 1))
    m, n = normals(before, e.z0), normals(e, e.z0)
    cosine = (m * np.conj(n)).real
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        q = np.asarray(e.z0 - distance * (m + n) / np.maximum(1 + cosine, 1e-3))
        for _ in range(STEPS):
            f, g = circle_distances(before, q) + distance, circle_distances(e, q) + distance
            m, n = normals(before, q), normals(e, q)
            det = (np.conj(m) * n).imag
            apart = np.abs(det) > 1e-7
            newton = 1j * (f * n - g * m) / np.where(apart, det, 1.0)
            q = q + np.where(apart, newton, -(f + g) / 2 * (m + n) / np.abs(m + n))
    residual = np.maximum(np.abs(f), np.abs(g))
    extent = float(np.ptp(e.z0.real) + np.ptp(e.z0.imag))
    bad = ~(residual <= 1e-9 * extent)
    if np.any(bad):
        z = e.z0[int(np.argmax(bad))]
        raise GeometryError(f"the edges at ({z.real:g}, {z.imag:g}) no longer meet when moved by {distance:g}")
    return q
