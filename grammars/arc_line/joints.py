"""Rewrites that tie the curves at a joint, or free them, and what each would change in the loss of the whole program.

A joint's place along a nearly tangent curve is hardly seen in a picture, but its tangency fixes it. A trial inside a
window would not do: the curves give way along their whole length. So the loss is linearised: with the Gauss-Newton
matrix H, tying what is off by c (kinks, a bulge) with the derivatives G costs c' (G H^-1 G')^-1 c / 2, and freeing a
joint that pulls with the multiplier m gains m^2 (g H^-1 g') / 2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from d4cad.grammars.arc_line.structure import Layout, Structure
from d4cad.grammars.arc_line.tangency import kinks
from d4cad.program import Floats, Program, Rewrite, dense
from d4cad.protocols import STIFF, Evaluation, Trial

JOINTS = ("smooth", "sharpen", "fillet", "straighten", "bend", "bridge")
"""The rules of this file. smooth, sharpen: vertex i becomes a smooth joint, or no longer is one. fillet: both ends of
arc i become smooth. straighten: arc i becomes a line, with smooth ends at the arcs beside it. bend: line i becomes an
arc with smooth ends. bridge: a line with smooth ends comes between both edges at vertex i."""
WIDEST = 0.6
"""The largest kink in radians that is proposed to be smooth."""
BENT = (0.08, 0.9)
"""The least and the largest kink in radians at both ends of a line that is proposed to be bent."""
DEEP = 6.0
"""The largest sagitta (px) of the arc."""
SHORT = 0.02
"""The least kink in radians at a vertex that is proposed to be bridged."""
FLAT = 0.2
"""The largest bulge of an arc that is proposed to be straight."""
DOUBT = 2.0
"""The loss is flatter than its linearisation says, for a joint slides along the curve: by so many prices of a primitive
may the gain be negative."""


def tied_at(rule: str, i: int, layout: Layout) -> list[int]:
    """The old vertices that a rewrite makes smooth."""
    if rule == "smooth":
        return [i]
    ends = [(i, int(layout.prv[i])), (int(layout.nxt[i]), int(layout.nxt[i]))]
    if rule == "bridge":
        return [i]
    if rule in ("fillet", "bend"):
        return [vertex for vertex, _ in ends]
    return [vertex for vertex, beside in ends if layout.arc[beside]] if rule == "straighten" else []


def bent(kinks_at_ends: tuple[float, float]) -> float:
    """The bulge of the arc that turns as a line does with its kinks."""
    return float(np.tan(sum(kinks_at_ends) / 4))


def joint_rewrites(program: Program[Structure], pixel: float) -> list[Rewrite]:
    """All that can be freed, and all that are off by little. pixel: in world units."""
    layout = program.structure.layout
    n = len(layout.nxt)
    smooth = set(program.structure.smooth)
    at = np.arange(n)
    angle, _ = kinks(program, at)
    small = np.abs(angle) < WIDEST
    bulge = np.where(layout.arc, program.params[np.maximum(layout.columns[:, 4], 0)], 0.0)
    points = program.params[: 2 * n].reshape(n, 2)
    chord = np.hypot(*(points[layout.nxt] - points).T)
    found = []
    for i in range(n):
        j = int(layout.nxt[i])
        if layout.arc[i] or layout.arc[layout.prv[i]]:
            if i in smooth:
                found.append(Rewrite("sharpen", frozenset((i,)), (float(i),)))
            elif small[i]:
                found.append(Rewrite("smooth", frozenset((i,)), (float(i),)))
                if abs(angle[i]) > SHORT:
                    found.append(Rewrite("bridge", frozenset((int(layout.prv[i]), i, j)), (float(i),)))
        ends = frozenset((i, j))
        if not layout.arc[i]:
            turns = (float(angle[i]), float(angle[j]))
            low, high = BENT
            if turns[0] * turns[1] > 0 and all(low < abs(turn) < high for turn in turns):
                bulge_of = bent(turns)
                if abs(bulge_of) * chord[i] / 2 < DEEP * pixel:
                    found.append(Rewrite("bend", ends, (float(i), bulge_of)))
            continue
        if small[i] and small[j] and not ends & smooth:
            found.append(Rewrite("fillet", ends, (float(i),)))
        if abs(bulge[i]) < FLAT and all(small[k] for k in tied_at("straighten", i, layout)):
            found.append(Rewrite("straighten", ends, (float(i),)))
    return found


def joint_trials(
    program: Program[Structure],
    rewrites: Sequence[Rewrite],
    evaluation: Evaluation,
    price: float,
    growths: Sequence[float],
) -> list[Trial]:
    """The rewrites that may pay. The evaluation needs a curvature; growths: (k,) of the complexity."""
    layout = program.structure.layout
    n = len(layout.nxt)
    kink, turning = kinks(program, np.arange(n))
    smooth = layout.smooth
    stiff = 2 * STIFF * price
    matrix = dense(evaluation.curvature) + stiff * turning[smooth].T @ turning[smooth]
    diagonal = np.diagonal(matrix)
    np.fill_diagonal(matrix, diagonal + 1e-9 * diagonal.max(initial=0.0) + 1e-7 * diagonal)
    # What may be off: the kink at every vertex, then every arc's bulge.
    bulges = np.eye(layout.size)[2 * n :]
    off = np.concatenate([kink, program.params[2 * n :]])
    ways = np.concatenate([turning, bulges])
    try:
        give = ways @ cho_solve(cho_factor(matrix), ways.T)
    except LinAlgError:
        return []
    pull = np.zeros(n)
    if smooth.size:
        pull[smooth], *_ = np.linalg.lstsq(turning[smooth].T, evaluation.gradient, rcond=None)
    found = []
    for rewrite, growth in zip(rewrites, growths, strict=True):
        i = int(rewrite.data[0])
        gain = -growth * price
        if rewrite.rule in ("bend", "bridge"):
            gain = 0.0  # too far from linear to be foretold
        elif rewrite.rule == "sharpen":
            gain += pull[i] ** 2 * give[i, i] / max(1 - stiff * give[i, i], 1e-12) / 2
        else:
            tied = [k for k in tied_at(rewrite.rule, i, layout) if k not in program.structure.smooth]
            if rewrite.rule == "straighten":
                tied.append(n + int(layout.columns[i, 4]) - 2 * n)
            gain -= _cost(off[tied], give[np.ix_(tied, tied)])
        if gain > -DOUBT * price:
            found.append(Trial(rewrite, float(gain)))
    return found


def _cost(off: Floats, give: Floats) -> float:
    """c' (G H^-1 G')^-1 c / 2."""
    scale = 1e-12 * float(np.trace(give)) * np.eye(len(off))
    try:
        return float(off @ np.linalg.solve(give + scale, off)) / 2
    except np.linalg.LinAlgError:
        return np.inf
