"""The two methods, as settings of the one loop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import Any

from d4cad.canvas import AREA, Canvas
from d4cad.descent import Method, Stage
from d4cad.estimators import LocalFit, Stepped
from d4cad.grammars.tree.structure import bounds as tree_bounds
from d4cad.grammars.tree.structure import subtree_metric
from d4cad.program import Floats, Program
from d4cad.steppers import ClippedGradient, LevenbergMarquardt

JOINTS = frozenset(("smooth", "sharpen", "fillet", "straighten", "bend", "bridge"))
CORNERS = frozenset(("round", "chamfer"))
"""Rules that a wide ramp hides the reason for, and that a split does as well where nothing else is hidden."""
GROWING = frozenset(("split", "split-lines", "split-three", "add-loop", "round", "chamfer"))
"""Rules that make more primitives."""
VISIBLE = 0.1
"""Gain in summed squared error (pixels) under which a primitive is hardly seen in a picture, however little noise it
has."""
OPEN = 2e-9
"""Price of a primitive for each pixel of the canvas under which a raster is exact to rounding in double precision."""
APPROXIMATED = 0.5
"""Gain in summed squared error that a primitive must have where lines and arcs can only come near to the shape: a tenth
of a pixel along fifty pixels."""
GROWTH = 2
"""So many primitives, and a tenth of all, may be added for gains less than visible: lines and arcs are found with few
more, other curves would be approximated without end."""


def paper(canvas: Canvas, metric: Callable[[Program[Any]], Floats] | None = None) -> Method:
    """The publication's settings (SPEC 1.7, AL-F): clipped gradient, 64 sampled proposals, one trial step, no re-check.

    ``metric``: the grammar's scaling of the gradient, if the paper has one.
    """
    return _published(canvas, ClippedGradient(metric=metric), 1e-5, (("add-loop", 0.25),))


def paper_rectangles(canvas: Canvas, metric: Callable[[Program[Any]], Floats]) -> Method:
    """The publication's settings for rectangles (SPEC 1.7, UR-F)."""
    return _published(canvas, ClippedGradient(rate=0.2, least=0.005, metric=metric), 1e-4)


def paper_tree(canvas: Canvas) -> Method:
    """The publication's settings for trees (SPEC 1.7, Tr-F)."""
    stepper = ClippedGradient(rate=0.5, least=0.1, metric=subtree_metric, bounds=tree_bounds)
    return _published(canvas, stepper, 1e-4, patience=10)


def _published(
    canvas: Canvas,
    stepper: ClippedGradient,
    price: float,
    reserved: tuple[tuple[str, float], ...] = (),
    patience: int = 25,
) -> Method:
    stage = Stage(ramp=canvas.ramp, price=price, rounds=200, patience=patience, tolerance=5e-3)
    return Method((stage,), (10, 10, 5), stepper, Stepped(stepper, 1), 64, reserved, recheck=False)


def fast(canvas: Canvas, floor: float = 6.5e-5) -> Method:
    """Ours: Levenberg-Marquardt, every proposal fitted locally, the ramp narrowing, the price of a primitive falling.

    ``floor``: the last price of a primitive, in summed squared error (pixels); the noise of the picture sets it.
    """
    prices = [0.65]
    while prices[-1] > floor * 1.001:
        prices.append(max(prices[-1] / 10, floor))
    least = VISIBLE if canvas.ramp == AREA else 0.0
    if floor < least:
        prices = sorted({*prices, least}, reverse=True)
    if floor > prices[0]:  # searched at the usual price, which leaves more ways open, then pruned at its own
        prices.append(floor)
    # Coverage of less width shows nothing of an edge that is further off, so the search narrows to it.
    wide = [
        Stage(ramp, prices[0] / canvas.size, rounds=1, without=JOINTS | CORNERS)
        for ramp in (3.0,)
        if ramp > canvas.ramp
    ]
    if canvas.ramp == AREA:
        wide.append(Stage(0.5, prices[0] / canvas.size, rounds=1000, without=JOINTS | CORNERS))
    without = JOINTS if canvas.ramp == AREA else JOINTS | CORNERS
    sharp = [
        Stage(canvas.ramp, price / canvas.size, 1000, without=without, growth=GROWTH if price < least else inf)
        for price in prices
    ]
    # Which joints are smooth is asked of a shape that is known otherwise, and only where the picture leaves it open.
    last = Stage(canvas.ramp, prices[-1] / canvas.size, rounds=1000)
    if least > floor:
        pruned = replace(last, without=GROWING)
        approximated = replace(last, price=APPROXIMATED / canvas.size, without=GROWING | JOINTS, fallback=True)
        sharp += [replace(last, growth=GROWTH), approximated, pruned]
    elif canvas.ramp == AREA or floor > OPEN * canvas.size:
        sharp.append(last)
    return Method((*wide, *sharp), (12, 6, 6), LevenbergMarquardt(), LocalFit(4))


def general(canvas: Canvas, floor: float = 0.0) -> Method:
    """Settings that suit any grammar: Levenberg-Marquardt, proposals scored by a few steps of the whole program.

    The ramp narrows from a sixteenth of the canvas, by which primitives find what is far from them; then the price of a
    primitive falls from a mean squared error of 1.6e-3 to 1e-5, or to ``floor`` as for :func:`fast`.
    """
    stepper = LevenbergMarquardt()
    prices = [max(price, floor / canvas.size) for price in (1.6e-3, 4e-4, 1e-4, 1e-5)]
    wide = [Stage(ramp, prices[0], rounds=4) for ramp in (max(canvas.shape) / 16, max(canvas.shape) / 64)]
    stages = [stage for stage in wide if stage.ramp > canvas.ramp]
    stages += [Stage(canvas.ramp, price, rounds=40) for price in prices]
    return Method(tuple(stages), (12, 6), stepper, Stepped(stepper, 8), sample=64)


def general_paper(canvas: Canvas, floor: float = 0.0) -> Method:
    """The publication's settings for a grammar that it does not have."""
    return _published(canvas, ClippedGradient(), 1e-4)


def fast_rectangles(canvas: Canvas, floor: float = 0.0) -> Method:
    """Ours for rectangles, which approach most shapes and seldom reach them: no price is low enough to end at.

    The price is a mean squared error, as the paper's is: it falls to the paper's 1e-4, where more rectangles pay than
    are wanted, and is then doubled, so that those go that earn the least. ``floor`` as for :func:`fast`.
    """
    prices = [max(price, floor / canvas.size) for price in (1.6e-3, 4e-4, 1e-4, 2e-4)]
    stages = tuple(Stage(canvas.ramp, price, rounds=100) for price in prices)
    return Method(stages, (12, 6, 6), LevenbergMarquardt(), LocalFit(8))


def fast_tree(canvas: Canvas, floor: float = 0.0) -> Method:
    """Ours for trees, which fill shapes with many leaves: the price of a node falls to where leaves only smooth the
    boundary. ``floor`` as for :func:`fast`."""
    prices = [max(price, floor / canvas.size) for price in (4e-4, 1e-4, 4e-5, 2e-5, 1e-5)]
    stages = tuple(Stage(canvas.ramp, price, rounds=60) for price in prices)
    return Method(stages, (8, 4), LevenbergMarquardt(bounds=tree_bounds, tolerance=1e-3), LocalFit(6))
