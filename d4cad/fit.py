"""From a picture to a fitted program: what the command line does, as functions."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from math import inf, isfinite, log10, sqrt
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from d4cad import exporters, io
from d4cad.canvas import AREA, PAPER_RAMP, Canvas
from d4cad.descent import Record, Stop, descend
from d4cad.edgemodel import exact, measured
from d4cad.errors import ExportError, GeometryError, InputError
from d4cad.exporters import preview
from d4cad.exporters.svg import svg
from d4cad.images import Picture, load
from d4cad.objectives.image import ImageLoss
from d4cad.outputs import check_output
from d4cad.placement import DEFAULT_DPI, DEFAULT_THICKNESS, Placement
from d4cad.preprocess import is_restless
from d4cad.program import Floats, Program
from d4cad.protocols import Composed, Grammar, Tracer
from d4cad.registry import entry, make_grammar, make_method
from d4cad.relations import Relation
from d4cad.sketch import Sketch
from d4cad.snapping import Snap, scale_of, snapped
from d4cad.tracing import traced

MARGIN = 8
"""Pixels of ground that are put around a picture whose shape touches its border."""

JOINING = (1e-4, 0.1)
"""Least and largest tolerance in pixels within which neighbouring edges are joined."""
LEEWAY = 3.0
"""That tolerance as a multiple of the root mean square distance by which the fit misses the picture's boundary."""
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


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted program and how it was found.

    psnr: dB of its coverage against the target. outline: its exact outline in world units, neighbours on one line or
    circle joined. seconds, wall: CPU and elapsed seconds of the optimisation. settings: what was asked for, as JSON
    values. made: size and origin that the picture or the program file states. target: (height, width) coverage, row 0
    lowest; None if the fit came from a program file. start_psnr, start_primitives: of the program that the search began
    with. snap: what regularisation has done, None if it was not asked for.
    """

    program: Program[Any]
    canvas: Canvas
    grammar: Grammar[Any]
    psnr: float
    outline: Sketch
    history: tuple[Record, ...]
    stop: Stop
    seconds: float
    wall: float
    settings: Mapping[str, Any]
    made: Placement = field(default_factory=Placement)
    target: Floats | None = None
    start_psnr: float = 0.0
    start_primitives: int = 0
    snap: Snap | None = None

    @property
    def relations(self) -> tuple[Relation, ...]:
        """What holds exactly between the edges of `outline`; its named sizes are ``outline.dimensions``."""
        return self.outline.relations

    @property
    def counted(self) -> str | None:
        """What the grammar counts, such as "rectangle"; None where the outline's edges count."""
        return entry(self.language).counted

    @property
    def language(self) -> str:
        """The name by which the grammar was asked for: its own, or MODULE:OBJECT."""
        return str(self.settings.get("grammar", self.grammar.name))

    @property
    def primitives(self) -> int:
        """Number of what the grammar counts, or else of lines and arcs of the outline, a full circle counting two."""
        return self.outline.primitives if self.counted is None else self.grammar.primitives(self.program)

    @property
    def coverage(self) -> Floats:
        """Coverage of the program on its canvas, (height, width), row 0 lowest."""
        return self.grammar.rasterize(self.program, self.canvas).coverage

    def placement(
        self,
        width: float | None = None,
        scale: float | None = None,
        dpi: float | None = None,
        origin: str | None = None,
        thickness: float | None = None,
    ) -> Placement:
        """What is given, and for the rest what the picture or the program file states."""
        origin = self.made.origin if origin is None else origin
        thickness = self.made.thickness if thickness is None else thickness
        given = Placement(width, scale, dpi, origin, thickness, self.made.zero)
        if given.sized:
            return given
        return replace(given, width=self.made.width, scale=self.made.scale, dpi=self.made.dpi)

    def sketch(
        self,
        width: float | None = None,
        scale: float | None = None,
        dpi: float | None = None,
        origin: str | None = None,
    ) -> Sketch:
        """The part's outline in mm, y up.

        At most one of width: the part's extent in x, in mm; scale: mm per pixel; dpi: pixels per inch. Without one the
        picture's own resolution counts, or 96 dpi. origin: as :class:`d4cad.placement.Placement` has it.
        """
        return self.placement(width, scale, dpi, origin).place(self.outline, self.canvas)

    def rectangles(
        self,
        width: float | None = None,
        scale: float | None = None,
        dpi: float | None = None,
        origin: str | None = None,
    ) -> tuple[Sketch, ...]:
        """The rectangles whose union the part is, each as a sketch in mm at its place in the part; they lap over each
        other. Size and origin as for :meth:`sketch`.

        Raises InputError for a grammar without rectangles.
        """
        if not isinstance(self.grammar, Composed):
            raise InputError(f"a program in the grammar {self.grammar.name} is not a union of rectangles")
        placement = self.placement(width, scale, dpi, origin)
        pieces = self.grammar.rectangles(self.program)
        return tuple(placement.place(self.outline, self.canvas, piece) for piece in pieces)

    def notes(self, placement: Placement, *, solid: bool) -> tuple[str, ...]:
        """What was assumed for a part so placed, a sentence each; ``solid``: whether a thickness matters."""
        found = [str(note) for note in self.settings.get("notes", ())]
        if not placement.sized:
            found.append(f"the picture states no resolution and no size was given: {DEFAULT_DPI:g} dpi assumed")
        if solid and placement.thickness is None:
            found.append(f"no thickness was given: {DEFAULT_THICKNESS:g} mm assumed")
        return tuple(found)

    def save(
        self,
        path: str | PathLike[str],
        *,
        thickness: float | None = None,
        width: float | None = None,
        scale: float | None = None,
        dpi: float | None = None,
        origin: str | None = None,
        **options: Any,
    ) -> None:
        """Write what the extension says: .json the program file, .step .stp .brep .stl .3mf .glb a solid of
        ``thickness`` mm, .py .scad its source code, .dxf .svg a drawing of the outline, .png a preview, .html a
        report.

        Size and origin as for :meth:`sketch`. options: name, color, kerf, form and all else in
        :class:`exporters.Options`, as far as the format takes them. Raises InputError for a bad value, ExportError if
        the file cannot be written; nothing is left behind then.
        """
        self.write(Path(path), self.placement(width, scale, dpi, origin, thickness), exporters.Options(**options))

    def write(self, path: Path, placement: Placement, options: exporters.Options | None = None) -> None:
        """As :meth:`save`, with the placement given as one value."""
        check_output(path, has_picture=self.target is not None, options=options)
        suffix = path.suffix.lower()
        if suffix == ".png":
            self.write_preview(path)
            return
        if suffix == ".html":
            from d4cad.reporting import write_page

            write_page(self, path, placement)
            return
        sketch = placement.place(self.outline, self.canvas)
        if suffix == ".json":
            io.write(path, self.document(sketch, placement))
        else:
            thickness = placement.thickness or DEFAULT_THICKNESS
            given = {} if options is None else options.given
            if suffix in exporters.SOURCES:  # code tells its reader where it comes from
                given.setdefault("name", str(self.settings.get("picture") or path.stem))
            exporters.write(sketch, path, thickness=thickness, **given)

    def write_preview(self, path: str | PathLike[str]) -> None:
        """Write target, outline with vertices, and error as .png or .svg. Raises ExportError."""
        if self.target is None:
            raise ExportError(f"cannot write {path}: a preview needs the picture, and a program file has none")
        count = f"{self.primitives} {self.counted or 'primitive'}s"
        title = f"{self.settings.get('picture', 'picture')}: {count}, {self.psnr:.1f} dB"
        preview.write_preview(Path(path), self.outline, self.canvas, self.target, self.coverage, title)

    def document(
        self, sketch: Sketch | None = None, placement: Placement | None = None, extra: Mapping[str, Any] | None = None
    ) -> io.ProgramFile:
        """The program file's contents: its loops those of ``sketch``, by default the outline in world units."""
        place = (
            {} if placement is None else {key: value for key, value in asdict(placement).items() if value is not None}
        )
        loops = self.outline if sketch is None else sketch
        return io.ProgramFile(
            grammar=self.language,
            structure=self.grammar.encode(self.program.structure),
            params=tuple(self.program.params.tolist()),
            canvas=self.canvas,
            settings={**self.settings, "placement": place},
            history=tuple(asdict(record) for record in self.history),
            stop=self.stop.name.lower(),
            psnr=self.psnr,
            primitives=self.primitives,
            unit=loops.unit,
            loops=loops.to_neutral(),
            relations=loops.relations,
            dimensions=loops.dimensions,
            extra={"cpu_s": self.seconds, "wall_s": self.wall, **(extra or {})},
        )

    @property
    def wrapped(self) -> Any:
        """The outline's faces in mm as one TopoDS shape, which CAD viewers show; raises as `Sketch.wrapped` does."""
        return self.sketch().wrapped

    def _repr_svg_(self) -> str:
        return svg(self.sketch())


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
) -> Fit:
    """Fit a program to a picture.

    image: a file, or an array (H, W) or (H, W, C) whose row 0 is the top. method: "fast" or "paper". variant: a named
    subset of the grammar's rewrites, None for all that the method uses. init: "contour", the picture's traced outline;
    "axiom", the grammar's own start; or a program file or fit to go on from. None is the contour for method "fast", if
    the grammar can draw it, and the axiom for "paper". max_time: seconds. threshold, invert, smooth, despeckle: as
    :func:`d4cad.images.load` has them. watch: called with a Record after every round. ramp: half-width in pixels of the
    picture's edges; None measures it, 1/sqrt(2) is the paper's exact raster. snap: make relations exact that the
    picture makes likely (:mod:`d4cad.regularize`); None: unless the method is "paper". size: of the part, if known:
    sizes in mm may be made round then. A picture of more than 1024 pixels a side is fitted at a coarse scale first, see
    :func:`d4cad.pyramid.fit_pyramid`. Raises InputError for what cannot be used. Ctrl-C ends the search with the best
    program so far.
    """
    _check_request(seed, max_time, ramp)
    start = _start(init, grammar)
    picture = load(image, threshold=threshold, invert=invert, smooth=smooth, despeckle=despeckle)
    asked = {"threshold": threshold, "invert": invert, "smooth": smooth, "despeckle": despeckle}
    return fit_picture(
        picture, method=method, grammar=grammar, variant=variant, init=start, seed=seed, max_time=max_time,
        watch=watch, ramp=ramp, snap=snap, size=size, asked=asked,
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
    if max_time is None and is_restless(target):
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
    border = np.concatenate([target[0], target[-1], target[:, 0], target[:, -1]])
    return np.pad(target, MARGIN) if np.any(border > 0.5) else target


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


def load_program(path: str | PathLike[str], grammar: str | None = None) -> Fit:
    """The fit that a program file or a drawing holds: see :func:`d4cad.programs.load`."""
    from d4cad.programs import load

    return load(path, grammar)


def joined_outline(grammar: Grammar[Any], program: Program[Any], canvas: Canvas, error: float) -> Sketch:
    """The program's outline in world units, with neighbours on one line or circle made one edge.

    error: mean squared error of the coverage. An edge may move by a few times what the fit is off already: d pixels
    off change the coverage of a boundary pixel by d / (2 ramp), or by d where it is area.
    """
    coverage = grammar.rasterize(program, canvas).coverage
    band = max(int(np.count_nonzero((coverage > 0) & (coverage < 1))), 1)
    off = LEEWAY * 2 * (canvas.ramp or 0.5) * sqrt(error * canvas.size / band)
    low, high = JOINING
    outline, tolerance = grammar.outline(program), min(max(off, low), high)
    while tolerance >= low:
        joined = outline.simplified(tolerance * canvas.pixel)
        with suppress(GeometryError):  # where two parts of the outline are nearer to each other than the tolerance
            return Sketch.from_loops(joined.loops, joined.unit)
        tolerance /= 10
    return outline


def decibels(error: float) -> float:
    """Peak signal-to-noise ratio of a mean squared error, at most 300 dB."""
    return -10 * log10(max(error, 1e-30))


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
    from d4cad.programs import moved_onto

    return moved_onto(start, target, canvas)


def _start(init: str | PathLike[str] | Fit | None, grammar: str) -> str | Fit | None:
    """The fit to go on from, or the name of a way to begin; None for the method's own."""
    if init is None or (isinstance(init, str) and init in STARTS):
        return init
    start = init if isinstance(init, Fit) else load_program(init, grammar)
    if start.language != grammar:
        raise InputError(f"the program to start from is in the grammar {start.language}, expected {grammar}")
    return start
