"""From a picture to a fitted program: what the command line does, as functions."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from math import inf, isfinite, log10, sqrt
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from d4cad import exporters, io
from d4cad.canvas import Canvas
from d4cad.descent import Record, Stop, descend
from d4cad.edgemodel import AREA_RAMP, exact, measured
from d4cad.errors import ExportError, GeometryError, InputError
from d4cad.exporters import preview
from d4cad.exporters.svg import svg
from d4cad.images import load
from d4cad.objectives.image import ImageLoss
from d4cad.outputs import check_output
from d4cad.placement import DEFAULT_DPI, DEFAULT_THICKNESS, Placement
from d4cad.program import Floats, Program
from d4cad.protocols import Grammar
from d4cad.registry import make_grammar, make_method
from d4cad.sketch import Sketch

MARGIN = 8
"""Pixels of ground that are put around a picture whose shape touches its border."""

JOINING = (1e-4, 0.1)
"""Least and largest tolerance in pixels within which neighbouring edges are joined."""
LEEWAY = 3.0
"""That tolerance as a multiple of the root mean square distance by which the fit misses the picture's boundary."""

Watch = Callable[[Record], None]


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted program and how it was found.

    psnr: dB of its coverage against the target. outline: its exact outline in world units, neighbours on one line or
    circle joined. seconds, wall: CPU and elapsed seconds of the optimisation. settings: what was asked for, as JSON
    values. made: size and origin that the picture or the program file states. target: (height, width) coverage, row 0
    lowest; None if the fit came from a program file.
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

    @property
    def primitives(self) -> int:
        """Number of lines and arcs of the outline, a full circle counting two."""
        return self.outline.primitives

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
    ) -> None:
        """Write what the extension says: .json the program file, .step .stp .brep .stl a solid of ``thickness`` mm,
        .svg a drawing of the outline, .png a preview.

        Size and origin as for :meth:`sketch`. Raises InputError for a bad number, ExportError if the file cannot be
        written; nothing is left behind then.
        """
        self.write(Path(path), self.placement(width, scale, dpi, origin, thickness))

    def write(self, path: Path, placement: Placement) -> None:
        """As :meth:`save`, with the placement given as one value."""
        check_output(path, has_picture=self.target is not None)
        suffix = path.suffix.lower()
        if suffix == ".png":
            self.write_preview(path)
            return
        sketch = placement.place(self.outline, self.canvas)
        if suffix == ".json":
            io.write(path, self.document(sketch, placement))
        else:
            exporters.write(sketch, path, thickness=placement.thickness or DEFAULT_THICKNESS)

    def write_preview(self, path: str | PathLike[str]) -> None:
        """Write target, outline with vertices, and error as .png or .svg. Raises ExportError."""
        if self.target is None:
            raise ExportError(f"cannot write {path}: a preview needs the picture, and a program file has none")
        title = f"{self.settings.get('picture', 'picture')}: {self.primitives} primitives, {self.psnr:.1f} dB"
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
            grammar=self.grammar.name,
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
            extra={"cpu_s": self.seconds, "wall_s": self.wall, **(extra or {})},
        )

    def _repr_svg_(self) -> str:
        return svg(self.sketch())


def fit_image(
    image: str | PathLike[str] | NDArray[Any],
    *,
    method: str = "fast",
    grammar: str = "arc-line",
    init: str | PathLike[str] | Fit = "axiom",
    seed: int = 0,
    max_time: float | None = None,
    threshold: float | None = None,
    invert: bool = False,
    watch: Watch | None = None,
    ramp: float | None = None,
) -> Fit:
    """Fit a program to a picture.

    image: a file, or an array (H, W) or (H, W, C) whose row 0 is the top. method: "fast" or "paper". init: "axiom",
    or a program file or fit to go on from. max_time: seconds. threshold: grey level in [0, 1] that makes the picture
    binary. invert: exchange shape and ground. watch: called with a Record after every round. ramp: half-width in pixels
    of the picture's edges; None measures it, 1/sqrt(2) is the paper's exact raster.
    Raises InputError for what cannot be used. Ctrl-C ends the search with the best program so far.
    """
    _check_request(seed, max_time, ramp)
    start = _start(init, grammar)
    picture = load(image, threshold=threshold, invert=invert)
    target = _framed(picture.target)
    canvas = Canvas.for_image(target.shape, AREA_RAMP if ramp is None else ramp)
    model = measured(target, picture.noise) if ramp is None else exact(target, canvas, picture.noise)
    fit = fit_coverage(
        target,
        canvas.with_ramp(model.ramp),
        method=method,
        grammar=grammar,
        init="axiom" if start is None else start,
        seed=seed,
        max_time=max_time,
        watch=watch,
        floor=model.floor,
    )
    asked = {"picture": picture.name, "threshold": threshold, "invert": invert}
    return replace(fit, settings={**asked, **fit.settings}, made=Placement(dpi=picture.dpi))


def fit_coverage(
    target: Floats,
    canvas: Canvas,
    *,
    method: str = "fast",
    grammar: str = "arc-line",
    init: str | PathLike[str] | Fit = "axiom",
    seed: int = 0,
    max_time: float | None = None,
    watch: Watch | None = None,
    floor: float | None = None,
) -> Fit:
    """Fit a program to coverage on a canvas: (height, width) in [0, 1], row 0 lowest.

    floor: the last price of a primitive for method "fast", in summed squared error; None if the target is a raster by
    the canvas' own edge model. The rest as for :func:`fit_image`.
    """
    _check_request(seed, max_time)
    if target.shape != canvas.shape:
        raise InputError(f"expected a target of shape {canvas.shape}, got {target.shape}")
    start = _start(init, grammar)
    floor = exact(target, canvas).floor if floor is None else floor
    language, settings = make_grammar(grammar, method, canvas), make_method(method, canvas, floor, grammar)
    if start is None:
        first = language.axiom(canvas)
    else:  # a wide ramp would first undo what was found
        first = _on_target(start, target, canvas)
        settings = replace(settings, stages=tuple(s for s in settings.stages if s.ramp == canvas.ramp))
    seen = [first]

    def note(record: Record, program: Program[Any]) -> None:
        seen.append(program)
        if watch is not None:
            watch(record)

    if max_time is not None:
        warm(grammar, method)
    cpu, wall = time.process_time(), time.perf_counter()
    found = descend(
        first,
        language,
        ImageLoss.of(target),
        canvas,
        settings,
        np.random.default_rng(seed),
        note,
        inf if max_time is None else max_time,
    )
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    program = _drawable(language, [*seen, found.program])
    error = float(np.mean((language.rasterize(program, canvas).coverage - target) ** 2))
    return Fit(
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
            "seed": seed,
            "init": "axiom" if start is None else "program",
            "max_time": max_time,
        },
        target=target,
    )


def _framed(target: Floats) -> Floats:
    """The target with a margin of ground where the shape runs up to the picture's border: the part ends there too."""
    border = np.concatenate([target[0], target[-1], target[:, 0], target[:, -1]])
    return np.pad(target, MARGIN) if np.any(border > 0.5) else target


def _drawable(grammar: Grammar[Any], programs: Sequence[Program[Any]]) -> Program[Any]:
    """The last program whose outline bounds a region, or the first one, which does.

    A program on its way may fold back on itself where Ctrl-C or the time limit ended the search.
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
    fit_coverage(target, Canvas.square(32), grammar=grammar, method=method, floor=10.0)


def load_program(path: str | PathLike[str]) -> Fit:
    """The fit that a program file or a drawing holds: see :func:`d4cad.programs.load`."""
    from d4cad.programs import load

    return load(path)


def joined_outline(grammar: Grammar[Any], program: Program[Any], canvas: Canvas, error: float) -> Sketch:
    """The program's outline in world units, with neighbours on one line or circle made one edge.

    error: mean squared error of the coverage. An edge may move by a few times what the fit is off already: d pixels
    off change the coverage of a boundary pixel by d / (2 ramp).
    """
    coverage = grammar.rasterize(program, canvas).coverage
    band = max(int(np.count_nonzero((coverage > 0) & (coverage < 1))), 1)
    off = LEEWAY * 2 * canvas.ramp * sqrt(error * canvas.size / band)
    low, high = JOINING
    return grammar.outline(program).simplified(min(max(off, low), high) * canvas.pixel)


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


def _start(init: str | PathLike[str] | Fit, grammar: str) -> Fit | None:
    """The fit to go on from; None for the axiom."""
    if init == "axiom":
        return None
    start = init if isinstance(init, Fit) else load_program(init)
    if start.grammar.name != grammar:
        raise InputError(f"the program to start from is in the grammar {start.grammar.name}, expected {grammar}")
    return start
