"""Large pictures: fitted at a coarse scale first, then on all their pixels from there."""

from __future__ import annotations

from dataclasses import replace
from math import ceil, inf
from typing import Any

import numpy as np

from d4cad.canvas import AREA, Canvas
from d4cad.edgemodel import measured
from d4cad.fit import Fit
from d4cad.fitting import Watch, fit_coverage
from d4cad.program import Floats
from d4cad.protocols import Tracer
from d4cad.registry import make_grammar

COARSE = 512
"""Pixels along the longer side of the coarse picture."""


def fit_pyramid(
    target: Floats,
    canvas: Canvas,
    *,
    noise: float = 0.0,
    floor: float | None = None,
    slack: float = 0.0,
    max_time: float | None = None,
    watch: Watch | None = None,
    coarse: int = COARSE,
    **options: Any,
) -> Fit:
    """Fit coverage (height, width) on a canvas by way of the same picture with at most ``coarse`` pixels a side.

    The search for the loops, lines and arcs then costs what it costs on the small picture, and the large one is left
    with their exact places and with what was too small to be seen. noise: standard deviation of a pixel. The rest as
    for :func:`d4cad.fitting.fit_coverage`; the history, the steps and the times are of both scales together.
    """
    step, grammar = ceil(max(canvas.shape) / coarse), make_grammar(options.get("grammar", "arc-line"), "fast", canvas)
    if step < 2 or not isinstance(grammar, Tracer):
        return fit_coverage(
            target, canvas, floor=floor, noise=noise, slack=slack, max_time=max_time, watch=watch, **options
        )
    small = shrunk(target, step)
    # Measured as the large one was: padding makes the small one's world a little wider, and its middle another.
    rough = Canvas.for_image(small.shape, AREA)
    model = measured(small, noise / step)
    first = fit_coverage(
        small,
        rough.with_ramp(model.ramp),
        floor=model.floor,
        noise=model.noise,
        slack=model.slack,
        max_time=max_time,
        watch=watch,
        **{**options, "snap": False},
    )
    left = inf if max_time is None else max_time - first.wall
    if left <= 0 or first.stop.name in ("TIME", "INTERRUPTED"):
        left = 1e-3  # the coarse outline is rasterised on the large picture and scored, no more
    second = fit_coverage(
        target,
        canvas,
        floor=floor,
        noise=noise,
        slack=slack,
        max_time=None if left == inf else left,
        watch=None if watch is None else lambda record: watch(replace(record, seconds=first.wall + record.seconds)),
        **{**options, "init": _enlarged(first, grammar, canvas, step)},
    )
    steps = first.history[-1].step if first.history else 0
    later = [replace(r, step=steps + r.step, seconds=first.wall + r.seconds) for r in second.history]
    return replace(
        second,
        history=(*first.history, *later),
        stop=first.stop if first.stop.name in ("TIME", "INTERRUPTED") else second.stop,
        seconds=first.seconds + second.seconds,
        wall=first.wall + second.wall,
        settings={**second.settings, "init": first.settings["init"], "max_time": max_time, "coarse": step},
    )


def shrunk(target: Floats, step: int) -> Floats:
    """Means over squares of ``step`` pixels from the lower left corner; ground is added at the far sides to fill them.

    A ramp of area coverage stays one: its half-width is half a pixel at every scale.
    """
    height, width = (-(-n // step) for n in target.shape)
    wide = np.pad(target, ((0, height * step - target.shape[0]), (0, width * step - target.shape[1])))
    return np.asarray(wide.reshape(height, step, width, step).mean(axis=(1, 3)))


def _enlarged(first: Fit, grammar: Tracer, canvas: Canvas, step: int) -> Fit:
    """The coarse fit's program in the world of the large canvas."""
    outline = first.grammar.outline(first.program)
    rough = first.canvas
    # Both pictures share their lower left corner; a coarse pixel is `step` pixels of the large canvas.
    x, y = rough.extent
    moved = outline.translated(x, y).scaled(step * canvas.pixel / rough.pixel, "world")
    middle = canvas.extent
    return replace(first, program=grammar.drawn(moved.translated(-middle[0], -middle[1]).loops), canvas=canvas)
