"""From a picture to a fitted program: what the command line does, as functions."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from math import inf, isfinite
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from d4cad.canvas import AREA, PAPER_RAMP, Canvas
from d4cad.descent import Record, Stop, descend
from d4cad.edgemodel import exact, measured
from d4cad.errors import GeometryError, InputError
from d4cad.fit import Fit, decibels, joined_outline
from d4cad.images import Picture, load
from d4cad.objectives.image import ImageLoss
from d4cad.placement import Placement
from d4cad.preprocess import is_restless
from d4cad.program import Floats, Program
from d4cad.programs import load_program, moved_onto
from d4cad.protocols import Grammar, Tracer
from d4cad.registry import entry, make_grammar, make_method
from d4cad.snapping import scale_of, snapped
from d4cad.tracing import traced

MARGIN = 8
"""Pixels of ground that are put around a picture whose shape touches its border."""
MOST_SNAPPED = 500
"""Parameters of an outline, about 220 edges, above which relations are not looked for: time grows with their cube."""
STARTS = ("contour", "axiom")
"""Ways to begin without a program."""
LARGE = 1024
"""Pixels along a picture's longer side above which a coarse picture comes first."""
NOISE_LIKE = 12.0
"""dB below which a picture is not one of an outline: a blank page of two equal levels has 6."""
PATIENCE = 20.0
"""Seconds that a picture of noise has where no time limit is given."""
Watch = Callable[[Record], None]
Follow = Callable[[Record | None, Floats], None]
"""Called with what the search begins with, and after every round: its record, and coverage (height, width), row 0
lowest."""


def fit_image(
    image: str | PathLike[str] | NDArray[Any],
    *,
    method: str = "fast",
    grammar: str = "arc-line",
    variant: str | None = None,
    init: str | PathLike[str] | Fit | None = None,
    seed: int = 0,
    max_time: float | None = None,
    threshold: str | float | None = None,
    invert: bool = False,
    watch: Watch | None = None,
    ramp: float | None = None,
    snap: bool | None = None,
    size: Placement | None = None,
    smooth: float = 0.0,
    despeckle: int = 0,
    follow: Follow | None = None,
) -> Fit:
    """Fit a program to a picture.

    image: a file, or an array (H, W) or (H, W, C) whose row 0 is the top. method: "fast" or "paper". variant: a named
    subset of the grammar's rewrites, None for all that the method uses. init: "contour", the picture's traced outline;
    "axiom", the grammar's own start; or a program file or fit to go on from. None is the contour for method "fast", if
    the grammar can draw it, and the axiom for "paper". max_time: seconds. threshold, invert, smooth, despeckle: as
    :func:`d4cad.images.load` has them. watch: called with a Record after every round; follow: with coverage too. ramp:
    half-width in pixels of the picture's edges; None measures it, 1/sqrt(2) is the paper's exact raster. snap: make
    relations exact that the picture makes likely (:mod:`d4cad.regularize`); None: unless the method is "paper". size:
    of the part, if known: sizes in mm may be made round then. A picture of more than 1024 pixels a side is fitted at a
    coarse scale first, see :func:`d4cad.pyramid.fit_pyramid`. Raises InputError for what cannot be used. Ctrl-C ends
    the search with the best program so far.
    """
    _check_request(seed, max_time, ramp)
    start = _start(init, grammar)
    picture = load(image, threshold=threshold, invert=invert, smooth=smooth, despeckle=despeckle)
    asked = {"threshold": threshold, "invert": invert, "smooth": smooth, "despeckle": despeckle}
    return fit_picture(
        picture, method=method, grammar=grammar, variant=variant, init=start, seed=seed, max_time=max_time,
        watch=watch, ramp=ramp, snap=snap, size=size, asked=asked, follow=follow,
    )  # fmt: skip


def fit_picture(
    picture: Picture,
    *,
    method: str = "fast",
    grammar: str = "arc-line",
    variant: str | None = None,
    init: str | Fit | None = None,
    seed: int = 0,
    max_time: float | None = None,
    watch: Watch | None = None,
    ramp: float | None = None,
    snap: bool | None = None,
    size: Placement | None = None,
    asked: Mapping[str, Any] | None = None,
    follow: Follow | None = None,
) -> Fit:
    """Fit a program to a picture that is loaded; ``asked``: settings of its loading for the record.

    The rest as for :func:`fit_image`.
    """
    target = _framed(picture.target)
    canvas = Canvas.for_image(target.shape, AREA if ramp is None else ramp)
    model = measured(target, picture.noise) if ramp is None else exact(target, canvas, picture.noise)
    if not entry(grammar).area:
        model = model.ramped()
    notes = [*picture.notes]
    restless = is_restless(target)
    if restless and init is None:  # noise has thousands of contours, which would take gigabytes to fit
        init = "axiom"
    if max_time is None and restless:
        max_time = PATIENCE
        notes.append(f"the picture looks like noise: the search has {max_time:g} s unless a time limit is given")
    fitted: Callable[..., Fit] = fit_coverage
    if init is None and method == "fast" and max(canvas.shape) > LARGE:
        from d4cad.pyramid import fit_pyramid

        fitted = fit_pyramid
    fit = fitted(
        target,
        canvas.with_ramp(model.ramp),
        method=method,
        grammar=grammar,
        variant=variant,
        init=init,
        seed=seed,
        max_time=max_time,
        watch=watch,
        floor=model.floor,
        noise=model.noise,
        slack=model.slack,
        snap=snap,
        size=size,
        follow=follow,
    )
    if fit.psnr < NOISE_LIKE:
        notes.append(f"the outline explains little of the picture ({fit.psnr:.1f} dB): is it noise or shaded?")
    settings = {"picture": picture.name, **(asked or {}), **fit.settings, **({"notes": notes} if notes else {})}
    return replace(fit, settings=settings, made=Placement(dpi=picture.dpi))


def fit_coverage(
    target: Floats,
    canvas: Canvas,
    *,
    method: str = "fast",
    grammar: str = "arc-line",
    variant: str | None = None,
    init: str | PathLike[str] | Fit | None = "axiom",
    seed: int = 0,
    max_time: float | None = None,
    watch: Watch | None = None,
    floor: float | None = None,
    noise: float = 0.0,
    slack: float = 0.0,
    snap: bool | None = None,
    size: Placement | None = None,
    follow: Follow | None = None,
) -> Fit:
    """Fit a program to coverage on a canvas: (height, width) in [0, 1], row 0 lowest.

    floor: the last price of a primitive for method "fast", in summed squared error; None if the target is a raster by
    the canvas' own edge model. noise: standard deviation of a pixel, which a contour is smoothed for. slack: as in
    :class:`d4cad.raster.band.SquaresTable`. The rest as for
    :func:`fit_image`.
    """
    _check_request(seed, max_time)
    if target.shape != canvas.shape:
        raise InputError(f"expected a target of shape {canvas.shape}, got {target.shape}")
    start, snap = _start(init, grammar), method != "paper" if snap is None else snap
    floor = exact(target, canvas).floor if floor is None else floor
    language = make_grammar(grammar, method, canvas, variant, target)
    settings = make_method(method, canvas, floor, grammar)
    if max_time is not None:
        warm(grammar, method)
    cpu, wall = time.process_time(), time.perf_counter()
    if start is None:
        start = "contour" if method == "fast" and isinstance(language, Tracer) else "axiom"
    first = _first(start, language, target, canvas, noise)
    if start != "axiom":  # a wide ramp would first undo what was found
        settings = replace(settings, stages=tuple(s for s in settings.stages if s.ramp == canvas.ramp))
    seen = [first]

    def note(record: Record, program: Program[Any]) -> None:
        seen.append(program)
        if watch is not None:
            watch(record)
        if follow is not None:
            follow(record, language.rasterize(program, canvas).coverage)

    if follow is not None:
        follow(None, language.rasterize(first, canvas).coverage)

    found = descend(
        first,
        language,
        ImageLoss.of(target, slack),
        canvas,
        settings,
        np.random.default_rng(seed),
        note,
        inf if max_time is None else max_time,
    )
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    program = _drawable(language, [language.axiom(canvas), *seen, found.program])
    error = float(np.mean((language.rasterize(program, canvas).coverage - target) ** 2))
    fit = Fit(
        program=program,
        canvas=canvas,
        grammar=language,
        psnr=decibels(error),
        outline=joined_outline(language, program, canvas, error),
        history=found.history,
        stop=found.stop,
        seconds=cpu,
        wall=wall,
        settings={
            "method": method,
            "variant": variant,
            "seed": seed,
            "init": start if isinstance(start, str) else "program",
            "max_time": max_time,
            "snap": snap,
            "floor": floor,
            **({} if language.name == grammar else {"grammar": grammar}),
        },
        target=target,
        start_psnr=decibels(float(np.mean((language.rasterize(first, canvas).coverage - target) ** 2))),
        start_primitives=language.primitives(first),
    )
    return regularised(fit, size, slack) if snap and fit.stop is not Stop.INTERRUPTED else fit


def regularised(fit: Fit, size: Placement | None = None, slack: float = 0.0) -> Fit:
    """The fit with the relations that its picture makes likely (:mod:`d4cad.regularize`), its program drawing the
    regularised outline. size: of the part, if round sizes in mm are wanted. slack: as for
    :func:`fit_coverage`. Raises InputError for a fit without target.
    """
    if fit.target is None:
        raise InputError("a fit from a program file has no picture to be regularised by")
    grammar = fit.grammar
    if not isinstance(grammar, Tracer) or grammar.drawn(fit.outline.loops).params.size > MOST_SNAPPED:
        return fit
    cpu, wall = time.process_time(), time.perf_counter()
    scale = scale_of(size, fit.canvas)
    try:
        with threadpool_limits(limits=1):
            snap, program = snapped(fit.outline, grammar, fit.canvas, fit.target, scale, slack)
    except KeyboardInterrupt:
        return replace(fit, stop=Stop.INTERRUPTED)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    if not snap.relations:
        return replace(fit, snap=snap, seconds=fit.seconds + cpu, wall=fit.wall + wall)
    return replace(
        fit,
        program=program,
        outline=snap.sketch,
        psnr=decibels(float(np.mean((fit.grammar.rasterize(program, fit.canvas).coverage - fit.target) ** 2))),
        seconds=fit.seconds + cpu,
        wall=fit.wall + wall,
        snap=snap,
    )


def _first(start: str | Fit, language: Grammar[Any], target: Floats, canvas: Canvas, noise: float) -> Program[Any]:
    """The program to begin with; the axiom where there is no contour."""
    if isinstance(start, Fit):
        return _on_target(start, target, canvas)
    if start == "contour":
        if not isinstance(language, Tracer):
            raise InputError(
                f"the grammar {language.name} cannot start from a contour, expected --init axiom or a file"
            )
        loops = traced(target, canvas, noise)
        if loops:
            return language.drawn(loops)
    return language.axiom(canvas)


def _framed(target: Floats) -> Floats:
    """The target with a margin of ground where the shape runs up to the picture's border: the part ends there too."""
    return np.pad(target, MARGIN) if touches_border(target) else target


def touches_border(target: Floats) -> bool:
    """Whether the shape in a target (height, width) runs up to its border."""
    return bool((np.concatenate([target[0], target[-1], target[:, 0], target[:, -1]]) > 0.5).any())


def _drawable(grammar: Grammar[Any], programs: Sequence[Program[Any]]) -> Program[Any]:
    """The last program whose outline bounds a region, or the first one, which does.

    A program on its way, or a contour traced in noise, may fold back on itself where Ctrl-C or the time limit ended the
    search.
    """
    return next((program for program in reversed(programs[1:]) if _bounds_a_region(grammar, program)), programs[0])


def _bounds_a_region(grammar: Grammar[Any], program: Program[Any]) -> bool:
    try:
        grammar.outline(program)
    except GeometryError:
        return False
    return True


@cache
def warm(grammar: str, method: str) -> None:
    """Compile or load the kernels, once in a process, so that no time limit or measured time has it."""
    target = np.zeros((32, 32))
    target[8:24, 8:24] = 1
    target[16:24, 16:24] = 0
    for ramp in (AREA, PAPER_RAMP) if entry(grammar).area else (PAPER_RAMP,):
        fit_coverage(target, Canvas.square(32, ramp), grammar=grammar, method=method, init=None, floor=10.0)


def _check_request(seed: int, max_time: float | None, ramp: float | None = None) -> None:
    if seed < 0:
        raise InputError(f"the seed must be 0 or more, got {seed}")
    for name, value in (("time limit", max_time), ("ramp", ramp)):
        if value is not None and not (isfinite(value) and value > 0):
            raise InputError(f"the {name} must be a positive number, got {value:g}")


def _on_target(start: Fit, target: Floats, canvas: Canvas) -> Program[Any]:
    """The program to go on from: as it is, or a drawing's moved onto the shape in the target."""
    if "drawing" not in start.settings:
        return start.program

    return moved_onto(start, target, canvas)


def _start(init: str | PathLike[str] | Fit | None, grammar: str) -> str | Fit | None:
    """The fit to go on from, or the name of a way to begin; None for the method's own."""
    if init is None or (isinstance(init, str) and init in STARTS):
        return init
    start = init if isinstance(init, Fit) else load_program(init, grammar)
    if start.language != grammar:
        raise InputError(f"the program to start from is in the grammar {start.language}, expected {grammar}")
    return start
