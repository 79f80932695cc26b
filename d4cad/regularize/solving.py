"""The joint solution: the least move, in standard deviations of the picture's evidence, that makes relations hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import lstsq

from d4cad.edges import Floats
from d4cad.regularize.equations import Equations, equations, gauge, stacked
from d4cad.regularize.measures import Measures
from d4cad.regularize.parameters import Parameters
from d4cad.relations import Relation

ROUNDS = 20
SLOW = 4
"""Rounds after which each has to halve the residual of the one before: where equations contradict, none does."""
SATISFIED = 1e-11
"""Largest residual, in radians, ratios or the sketch's unit, of a solved system."""
SETTLED = 1e-7
"""Change of the move in standard deviations below which the least one is found."""
DEPENDENT = 1e-6
"""Singular values below this share of the largest belong to equations that follow from others."""
FURTHEST = 1e3


def solved(relations: Sequence[Relation], layout: Parameters, anchor: Floats, spread: Floats) -> Floats | None:
    """The parameters (n,) nearest to ``anchor`` at which every relation holds, or None if there are none near it.

    Nearest in the metric of ``spread`` (:meth:`Evidence.spread`). Sequential quadratic programming: each round solves
    the equations linearised at the last solution for the least u in params = anchor + spread u. Equations that follow
    from others are found by a rank-revealing QR factorisation (Golub and Van Loan, 5.5) and left out.
    """
    u = np.zeros(spread.shape[1])
    params, last = anchor, np.inf
    for k in range(ROUNDS):
        system = linearised(relations, layout, params)
        worst = float(np.abs(system.residual).max(initial=0.0))
        rows = system.rows @ spread
        size = np.linalg.norm(rows, axis=1)
        if not (np.isfinite(worst) and np.all(np.isfinite(size))) or np.any(size == 0):
            return None
        if worst <= SATISFIED and k == 0:  # also so that snapping twice changes no bit
            return anchor
        if k >= SLOW and worst > max(last / 2, SATISFIED):
            return None
        last = worst
        goal = (rows @ u - system.residual) / size
        new, *_ = lstsq(rows / size[:, None], goal, cond=DEPENDENT, lapack_driver="gelsy")
        moved = float(np.linalg.norm(new - u))
        if not np.isfinite(moved) or np.linalg.norm(new) > FURTHEST * (1 + len(new)):
            return None
        u = new
        params = anchor + spread @ u
        if worst <= SATISFIED and moved <= SETTLED * (1 + float(np.linalg.norm(u))):
            return np.asarray(params)
    left = float(np.abs(linearised(relations, layout, params).residual).max(initial=0.0))
    return np.asarray(params) if left <= SATISFIED else None


def linearised(relations: Sequence[Relation], layout: Parameters, params: Floats) -> Equations:
    """The equations of all relations, and of the sketch's own gauge, at ``params``: not finite for an edge without a
    length, as a step may leave one."""
    with np.errstate(divide="ignore", invalid="ignore"):
        measures = Measures.of(layout, params)
        parts = [equations(relation, layout, measures) for relation in relations]
    return stacked([gauge(layout, measures), *parts], params.size)
