"""A density field for a start: compliance minimised element by element, filtered and projected (SIMP).

Bendsoe and Sigmund, "Topology Optimization" (2003), with the sensitivities of Andreassen et al., "Efficient topology
optimization in MATLAB using 88 lines of code" (2011), and the projection of Wang, Lazarov and Sigmund (2011). It finds
which holes and bars there are; their exact shape is the business of the program that starts from its contour.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, sqrt

import numpy as np

from d4cad.objectives.domain import Domain
from d4cad.program import Floats

VOID = 1e-6
"""Stiffness of an empty element as a share of the solid's: low enough for the topology, high enough to solve well."""


@dataclass(frozen=True, slots=True)
class Schedule:
    """radius: of the filter, in elements. iterations: of the optimality criteria. ramp: iterations in which the penalty
    exponent grows from 1 to ``exponent``. sharpen: every so many iterations the projection's slope grows by ``growth``
    up to ``sharpest``. move: the largest change of a density in an iteration.
    """

    radius: float = 2.4
    iterations: int = 120
    exponent: float = 3.0
    ramp: int = 40
    sharpen: int = 25
    growth: float = 1.6
    sharpest: float = 8.0
    move: float = 0.2


def optimised_density(domain: Domain, schedule: Schedule = Schedule()) -> Floats:
    """Densities (height, width) in [0, 1] that use the domain's volume."""
    s = schedule
    kernel = _cone(s.radius)
    free = domain.free
    share = _blurred(domain.inside.astype(float), kernel)

    def filtered(x: Floats) -> Floats:
        return np.asarray(_blurred(x * domain.inside, kernel) / np.maximum(share, 1e-9))

    def spread(g: Floats) -> Floats:  # the filter's transpose
        return np.asarray(_blurred(g * domain.inside / np.maximum(share, 1e-9), kernel) * domain.inside)

    x = np.where(free, domain.free_fraction, domain.solid.astype(float))
    slope = 1.0
    for step in range(s.iterations):
        if step > s.ramp and step % s.sharpen == 0:
            slope = min(slope * s.growth, s.sharpest)
        p = 1 + (s.exponent - 1) * min(1.0, step / s.ramp)
        soft = filtered(x)
        rho = domain.clamped(_projected(soft, slope))
        energy = domain.work(VOID + rho**p * (1 - VOID)).energy
        sharp = _projection_slope(soft, slope)
        gain = spread(p * rho ** (p - 1) * energy * sharp * free)
        cost = spread(sharp * free)
        x = _criteria(domain, x, gain, cost, s.move, lambda y, b=slope: _projected(filtered(y), b))
    return domain.clamped(_projected(filtered(x), slope))


def _criteria(domain: Domain, x: Floats, gain: Floats, cost: Floats, move: float, physical: object) -> Floats:
    """One update by optimality criteria, its multiplier found by bisection on the volume."""
    worth = np.sqrt(np.maximum(gain, 0.0) / np.maximum(cost, 1e-12))
    low, high = 1e-9, 1e9
    while high / low > 1 + 1e-5:
        middle = sqrt(low * high)
        y = np.clip(x * worth / sqrt(middle), np.maximum(0.0, x - move), np.minimum(1.0, x + move))
        y = domain.clamped(y)
        if domain.clamped(physical(y)).sum() > domain.volume:  # type: ignore[operator]
            low = middle
        else:
            high = middle
    return y


def _cone(radius: float) -> Floats:
    reach = np.arange(-ceil(radius) + 1, ceil(radius))
    return np.maximum(0.0, radius - np.hypot(*np.meshgrid(reach, reach)))


def _blurred(x: Floats, kernel: Floats) -> Floats:
    from scipy.ndimage import convolve

    return np.asarray(convolve(x, kernel, mode="constant"))


def _projected(x: Floats, slope: float) -> Floats:
    """A smoothed step at one half."""
    edge = np.tanh(slope / 2)
    return np.asarray((edge + np.tanh(slope * (x - 0.5))) / (2 * edge))


def _projection_slope(x: Floats, slope: float) -> Floats:
    return np.asarray(slope * (1 - np.tanh(slope * (x - 0.5)) ** 2) / (2 * np.tanh(slope / 2)))
