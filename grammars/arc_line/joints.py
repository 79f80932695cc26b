"""Rewrites that make a joint smooth, or free it, and what each would change in the loss of the whole program.

A joint's place along a nearly tangent curve is hardly seen in a picture, but its tangency fixes it. A trial inside a
window would not do: the curves give way along their whole length. So the loss is linearised: with the Gauss-Newton
matrix H and the joint's kink k and its derivative g, closing the kink costs k^2 / (2 g H^-1 g'), and freeing a joint
that pulls with the multiplier m gains m^2 (g H^-1 g') / 2.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from d4cad.grammars.arc_line.structure import Structure
from d4cad.grammars.arc_line.tangency import kinks
from d4cad.program import Program, Rewrite
from d4cad.protocols import STIFF, Evaluation, Trial

JOINTS = ("smooth", "sharpen")
"""The rules of this file."""
WIDEST = 0.6
"""The largest kink in radians that is proposed to be smooth."""


def joint_rewrites(program: Program[Structure]) -> list[Rewrite]:
    """Smooth joints to be freed, and the others at an arc that turn by little to be made smooth."""
    layout = program.structure.layout
    smooth = set(program.structure.smooth)
    at = np.flatnonzero(layout.arc | layout.arc[layout.prv])
    angle, _ = kinks(program, at)
    found = []
    for i, kink in zip(at.tolist(), angle.tolist(), strict=True):
        if i in smooth or abs(kink) < WIDEST:
            found.append(Rewrite("sharpen" if i in smooth else "smooth", frozenset((i,)), (float(i),)))
    return found


def joint_trials(
    program: Program[Structure], rewrites: Sequence[Rewrite], evaluation: Evaluation, price: float, weight: float
) -> list[Trial]:
    """The rewrites that pay, at ``weight`` times ``price`` a joint. The evaluation needs a curvature."""
    at = np.array([int(rewrite.data[0]) for rewrite in rewrites])
    kink, jacobian = kinks(program, at)
    tied = np.array([rewrite.rule == "sharpen" for rewrite in rewrites])
    held = jacobian[tied]
    stiff = 2 * STIFF * price
    matrix = evaluation.curvature + stiff * held.T @ held
    diagonal = np.diagonal(matrix)
    np.fill_diagonal(matrix, diagonal + 1e-9 * diagonal.max() + 1e-7 * diagonal)
    try:
        factor = cho_factor(matrix)
    except LinAlgError:
        return []
    give = np.einsum("kn,nk->k", jacobian, cho_solve(factor, jacobian.T))
    gain = weight * price - kink**2 / (2 * np.maximum(give, 1e-300))
    if tied.any():
        pull, *_ = np.linalg.lstsq(held.T, evaluation.gradient, rcond=None)
        free = give[tied] / np.maximum(1 - stiff * give[tied], 1e-12)
        gain[tied] = pull**2 * free / 2 - weight * price
    return [Trial(rewrites[k], float(gain[k])) for k in np.flatnonzero(gain > 0).tolist()]
