"""The classical rival: SIMP with a density filter, as the 88-line code has it.

Andreassen, Clausen, Schevenels, Lazarov and Sigmund, "Efficient topology optimization in MATLAB using 88 lines of
code", Struct. Multidisc. Optim. 43 (2011): modified SIMP of exponent 3, density filter, optimality criteria, no
continuation.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from d4cad.beams.problem import Problem
from d4cad.beams.stress import REFINEMENT, Analysis, analysed_elements
from d4cad.errors import InputError
from d4cad.objectives.domain import Domain
from d4cad.program import Floats

Bools = NDArray[np.bool_]

EXPONENT, WEAK, MOVE = 3.0, 1e-9, 0.2


@dataclass(frozen=True, slots=True, eq=False)
class SimpRun:
    """density: (height, width), filtered. model: its own compliance, of grey elements. iterations; seconds of CPU."""

    density: Floats
    model: float
    iterations: int
    seconds: float


def simp(domain: Domain, radius: float = 3.0, iterations: int = 200, change: float = 0.01) -> SimpRun:
    """Densities that use the domain's volume; ends after ``iterations`` or when no density changes by ``change``.

    radius: of the filter, in elements.
    """
    began = time.process_time()
    kernel, inside, free = _cone(radius), domain.inside, domain.free
    weight = np.maximum(_blurred(inside.astype(np.float64), kernel), 1e-9)
    x = np.where(free, domain.free_fraction, domain.solid.astype(np.float64))
    density = domain.clamped(_blurred(x * inside, kernel) / weight)
    compliance, step, moved = 0.0, 0, 1.0
    while step < iterations and moved > change:
        response = domain.work(WEAK + density**EXPONENT * (1 - WEAK))
        compliance = response.compliance
        gain = EXPONENT * density ** (EXPONENT - 1) * (1 - WEAK) * response.energy
        gain, cost = (_blurred(np.where(free, g, 0.0) / weight, kernel) for g in (gain, np.ones(x.shape)))
        worth = np.sqrt(np.maximum(gain, 0.0) / np.maximum(cost, 1e-12))
        low, high = 1e-12, 1e12
        new = x
        while high / low > 1 + 1e-6:
            middle = sqrt(low * high)
            new = np.clip(x * worth / sqrt(middle), np.maximum(0.0, x - MOVE), np.minimum(1.0, x + MOVE))
            new = np.where(free, new, domain.solid.astype(np.float64))
            density = domain.clamped(_blurred(new * inside, kernel) / weight)
            low, high = (middle, high) if density.sum() > domain.volume else (low, middle)
        moved, x, step = float(np.abs(new - x).max()), new, step + 1
    return SimpRun(density, compliance, step, time.process_time() - began)


def thresholded(problem: Problem, density: Floats, refinement: int = REFINEMENT) -> Bools:
    """Solid elements (height, width) of the fine grid that use the problem's volume: a density's level set.

    Between the centres of the design's elements the density is bilinear: the level set is then as smooth as a contour.
    """
    from scipy.ndimage import distance_transform_edt, map_coordinates

    coarse, fine = problem.domain(), problem.domain(refinement)
    nearest = distance_transform_edt(~coarse.inside, return_distances=False, return_indices=True)
    rows, cols = (((np.arange(n) + 0.5) / refinement) - 0.5 for n in fine.shape)
    at = np.meshgrid(rows, cols, indexing="ij")
    smooth = map_coordinates(density[tuple(nearest)], at, order=1, mode="nearest")
    room = round(fine.volume - float(fine.solid.sum()))
    order = np.argsort(-np.where(fine.free, smooth, -1.0), axis=None, kind="stable")
    found = np.zeros(fine.inside.size, dtype=np.bool_)
    found[order[:room]] = True
    return np.asarray((found.reshape(fine.shape) & fine.free) | fine.solid)


@dataclass(frozen=True, slots=True, eq=False)
class Rival:
    """A run and its thresholded part on the design's grid and on the fine one; None where it carries no load there."""

    run: SimpRun
    design: Analysis | None
    fine: Analysis | None


def compared(problem: Problem, radius: float = 3.0, iterations: int = 200) -> Rival:
    """SIMP at the problem's volume, its part analysed as any other is."""
    run = simp(problem.domain(), radius, iterations)

    def part(refinement: int) -> Analysis | None:
        try:
            return analysed_elements(problem, thresholded(problem, run.density, refinement), refinement)
        except InputError:
            return None

    return Rival(run, part(1), part(REFINEMENT))


def _cone(radius: float) -> Floats:
    reach = np.arange(-ceil(radius) + 1, ceil(radius))
    return np.maximum(0.0, radius - np.hypot(*np.meshgrid(reach, reach)))


def _blurred(x: Floats, kernel: Floats) -> Floats:
    from scipy.ndimage import convolve

    return np.asarray(convolve(x, kernel, mode="constant"))
