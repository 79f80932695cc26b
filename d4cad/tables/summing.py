"""What many results add up to: means with confidence intervals, and orders that hold or do not."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from math import log10

import numpy as np

from d4cad.program import Floats
from d4cad.tables.published import ORDER, PAPER
from d4cad.tables.running import Result
from d4cad.tables.sets import TWINS

MOST = 120.0
"""dB that count at most: an exact shape has as many as rounding leaves it."""
RESAMPLES = 2000
TIE = 0.5
"""dB within which two figures of the paper are called the same."""
LEAST = 4
"""Shapes with which an order may be decided at all."""
SAME = 1.0
"""dB within which the whole confidence interval of a difference must lie for ours to be the same."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One row of a table for one set.

    fits, failed: their numbers. mean, median, worst: PSNR in dB, each fit counted as MOST at most. low, high: the 95 %
    confidence interval of the mean over shapes. of_mean: PSNR of the mean squared error of all fits. primitives: the
    mean. seconds, median_s, worst_s: CPU seconds of a fit, the mean and so on.
    """

    method: str
    row: str
    set: str
    shapes: int
    seeds: int
    fits: int
    failed: int
    mean: float
    low: float
    high: float
    median: float
    worst: float
    of_mean: float
    primitives: float
    true_primitives: float
    seconds: float
    median_s: float
    worst_s: float


@dataclass(frozen=True, slots=True)
class Claim:
    """Whether a row is better than another on a set. published: the paper's difference in dB, None if not at hand.
    difference, low, high: ours, the mean over shapes and its 95 % confidence interval. verdict: in a word."""

    method: str
    set: str
    better: str
    worse: str
    published: float | None
    difference: float
    low: float
    high: float
    verdict: str


def cells(results: Sequence[Result]) -> list[Cell]:
    """One cell for every method, row and set, in the order of the results."""
    groups: dict[tuple[str, str, str], list[Result]] = defaultdict(list)
    for result in results:
        groups[result.method, result.row, result.set].append(result)
    return [_cell(*names, group) for names, group in groups.items()]


def _cell(method: str, row: str, name: str, group: Sequence[Result]) -> Cell:
    done = [result for result in group if result.error is None]
    psnr = np.array([min(result.psnr, MOST) for result in done] or [0.0])
    cpu = np.array([result.cpu_s for result in done] or [0.0])
    low, high = interval(np.array([*_by_shape(done).values()] or [0.0]))
    return Cell(
        method=method,
        row=row,
        set=name,
        shapes=len({result.index for result in group}),
        seeds=len({result.seed for result in group}),
        fits=len(group),
        failed=len(group) - len(done),
        mean=float(psnr.mean()),
        low=low,
        high=high,
        median=float(np.median(psnr)),
        worst=float(psnr.min()),
        of_mean=-10 * log10(float(np.mean(10 ** (-psnr / 10)))),
        primitives=float(np.mean([float(result.primitives) for result in done] or [0.0])),
        true_primitives=float(np.mean([float(result.true_primitives) for result in done] or [0.0])),
        seconds=float(cpu.mean()),
        median_s=float(np.median(cpu)),
        worst_s=float(cpu.max()),
    )


def _by_shape(results: Sequence[Result]) -> dict[int, float]:
    """PSNR of every shape, the mean over its seeds."""
    found: dict[int, list[float]] = defaultdict(list)
    for result in results:
        found[result.index].append(min(result.psnr, MOST))
    return {index: float(np.mean(values)) for index, values in found.items()}


def interval(values: Floats) -> tuple[float, float]:
    """The 95 % confidence interval of the mean of ``values`` (n,), by the percentiles of resampled means."""
    rng = np.random.default_rng(0)
    means = values[rng.integers(len(values), size=(RESAMPLES, len(values)))].mean(axis=1)
    low, high = np.percentile(means, (2.5, 97.5))
    return float(low), float(high)


def claims(results: Sequence[Result]) -> list[Claim]:
    """Every order of the paper's for which both rows are at hand, shape by shape."""
    done = [result for result in results if result.error is None]
    groups: dict[tuple[str, str, str], list[Result]] = defaultdict(list)
    for result in done:
        groups[result.method, result.set, result.row].append(result)
    found = []
    for method, name in dict.fromkeys((result.method, result.set) for result in done):
        for better, worse in ORDER:
            one, other = (_by_shape(groups.get((method, name, row), [])) for row in (better, worse))
            shared = sorted(one.keys() & other.keys())
            if shared:
                difference = np.array([one[index] - other[index] for index in shared])
                found.append(_claim(method, name, better, worse, difference))
    return found


def _claim(method: str, name: str, better: str, worse: str, difference: Floats) -> Claim:
    twin = TWINS.get(name, name)
    published = None
    if twin in PAPER.get(better, {}) and twin in PAPER.get(worse, {}):
        published = PAPER[better][twin].psnr - PAPER[worse][twin].psnr
    low, high = interval(difference)
    word = verdict(published, low, high) if len(difference) >= LEAST else "undecided"
    return Claim(method, name, better, worse, published, float(difference.mean()), low, high, word)


def verdict(published: float | None, low: float, high: float) -> str:
    """ "confirmed" or "refuted" where the interval of our difference decides it, else "undecided".

    Without a published difference the claim is that it is positive; one of less than TIE is that there is none.
    """
    if published is not None and abs(published) < TIE:
        if low >= -SAME and high <= SAME:
            return "confirmed"
        return "refuted" if low > SAME or high < -SAME else "undecided"
    sign = -1.0 if published is not None and published < 0 else 1.0
    low, high = sorted((sign * low, sign * high))
    return "confirmed" if low > 0 else "refuted" if high < 0 else "undecided"
