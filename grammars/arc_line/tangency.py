"""Smooth joints: the two edges at a vertex share their tangent there.

The tangent of an edge turns from phi - h to phi + h, phi the chord's angle and h = 2 atan(b) half the sweep. At a
vertex the *kink* is the angle from the tangent that comes in to the one that goes out; where it is 0 the joint is
smooth.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from d4cad.grammars.arc_line.structure import Structure
from d4cad.program import Floats, Program

ROUNDS = 8
"""Newton's rule doubles the digits in each; so many are for a start that is far off."""
NEAR = 1e-12


def kinks(program: Program[Structure], at: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Kinks at the vertices ``at`` (k,) in radians, left turns positive, and their derivatives (k, n)."""
    layout = program.structure.layout
    if at.size == 0:
        return np.zeros(0), np.zeros((0, layout.size))
    n = len(layout.nxt)
    z = program.params[: 2 * n : 2] + 1j * program.params[1 : 2 * n : 2]
    b = np.zeros(n)
    b[layout.arc_edges] = program.params[2 * n :]
    before, after = layout.prv[at], layout.nxt[at]
    into, out = z[at] - z[before], z[after] - z[at]
    angle = np.angle(out * np.conj(into)) - 2 * np.arctan(b[at]) - 2 * np.arctan(b[before])
    row = np.arange(len(at))
    jacobian = np.zeros((len(at), layout.size))
    # d angle(c) = Im(dc / c): by x it is Im(1 / c), by y it is Re(1 / c).
    for chord, start, end, sign in ((out, at, after, 1.0), (into, before, at, -1.0)):
        turn = sign / np.where(np.abs(chord) > 0, chord, 1.0)
        for vertex, way in ((start, -1.0), (end, 1.0)):
            np.add.at(jacobian, (row, 2 * vertex), way * turn.imag)
            np.add.at(jacobian, (row, 2 * vertex + 1), way * turn.real)
    for edge in (before, at):
        bent = layout.arc[edge]
        jacobian[row[bent], layout.columns[edge[bent], 4]] -= 2 / (1 + b[edge[bent]] ** 2)
    return np.remainder(angle + np.pi, 2 * np.pi) - np.pi, jacobian


def smoothed(program: Program[Structure]) -> Program[Structure]:
    """The program with its smooth joints exactly smooth, moved as little as possible.

    Newton's rule with the least change of the parameters. Where joints contradict each other the program is returned as
    it was.
    """
    at = program.structure.layout.smooth
    params = program.params
    for _ in range(ROUNDS if at.size else 0):
        kink, jacobian = kinks(program.moved(params), at)
        if np.abs(kink).max() <= NEAR:
            return program.moved(params)
        change, *_ = np.linalg.lstsq(jacobian, -kink, rcond=1e-9)
        if not np.isfinite(change).all() or np.abs(change).max() > 0.1:
            return program
        params = params + change
    return program.moved(params) if at.size and np.abs(kink).max() <= 1e-6 else program
