"""Fits every shape of a folder whose truth is known, and compares with it."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, median
from typing import Any

from d4cad import io
from d4cad.canvas import Canvas
from d4cad.errors import D4cadError, InputError
from d4cad.fit import Fit
from d4cad.fitting import fit_coverage, fit_image, warm
from d4cad.grammars.arc_line import ArcLine
from d4cad.program import Floats
from d4cad.registry import make_grammar, make_method
from d4cad.sketch import Sketch

RESOLUTION = 256
EXACT = 80.0
"""A fit of this many dB with no more primitives than the truth counts as exact."""
SAME_CURVE = 1e-5
"""Tolerance in world units within which neighbours of a true shape are one line or circle."""


@dataclass(frozen=True, slots=True)
class Request:
    """What to fit and how.

    limit: shapes of each set, None for all. jobs: processes. max_time: seconds a shape. init: "contour" or "axiom";
    None for the method's own start from bitmaps, and the axiom for exact rasters. snap: as for `fit_image`. Raises
    InputError where a number or a name makes no sense.
    """

    data: Path
    out: Path
    bitmaps: Path | None = None
    grammar: str = "arc-line"
    variant: str | None = None
    method: str = "fast"
    seed: int = 0
    limit: int | None = None
    jobs: int = 1
    max_time: float | None = None
    init: str | None = None
    snap: bool | None = None

    def __post_init__(self) -> None:
        if self.limit is not None and self.limit < 1:
            raise InputError(f"the limit must be 1 or more, got {self.limit}")
        if self.jobs < 1:
            raise InputError(f"the number of jobs must be 1 or more, got {self.jobs}")
        canvas = Canvas.square(RESOLUTION)
        make_grammar(self.grammar, self.method, canvas, self.variant)
        make_method(self.method, canvas, 1.0, self.grammar)


@dataclass(frozen=True, slots=True)
class Case:
    """One shape: its set, its index there, its loops in the neutral format, world units."""

    set: str
    index: int
    loops: list[list[dict[str, Any]]]

    @property
    def name(self) -> str:
        """Stem of the files that belong to it."""
        return f"{self.set}_{self.index:03d}"


@dataclass(frozen=True, slots=True)
class Row:
    """One result. psnr: dB. cpu_s, wall_s: of the optimisation alone. start_psnr,
    start_primitives: of what the search started from. error: why there is no result, or None."""

    set: str
    index: int
    psnr: float
    primitives: int
    true_primitives: int
    exact: bool
    cpu_s: float
    wall_s: float
    stop: str
    start_psnr: float = 0.0
    start_primitives: int = 0
    error: str | None = None


def run(request: Request) -> list[Row]:
    """Fit all shapes and write one program file in world units for each. Raises InputError, ExportError."""
    cases = shapes(request.data, request.limit)
    if request.bitmaps is not None:
        missing = [case.name for case in cases if not (request.bitmaps / f"{case.name}.png").is_file()]
        if missing:
            raise InputError(f"{request.bitmaps} lacks {missing[0]}.png and {len(missing) - 1} more pictures")
    request.out.mkdir(parents=True, exist_ok=True)
    if request.jobs == 1:
        return [solve(case, request) for case in cases]
    from joblib import Parallel, delayed, parallel_config

    with parallel_config(backend="loky", inner_max_num_threads=1):
        return list(Parallel(n_jobs=request.jobs)(delayed(solve)(case, request) for case in cases))


def shapes(folder: Path, limit: int | None) -> list[Case]:
    """The first ``limit`` shapes of every ``{set}.json`` in the folder. Raises InputError where there are none."""
    files = sorted(folder.glob("*.json"))
    if not files:
        raise InputError(f"expected a folder with files {{set}}.json, but {folder} has none")
    return [case for path in files for case in _read_set(path)[:limit]]


def _read_set(path: Path) -> list[Case]:
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
        cases = [Case(path.stem, int(entry["index"]), list(entry["loops"])) for entry in entries]
    except (ValueError, KeyError, TypeError):
        cases = []
    if not cases:
        raise InputError(f"{path} is not a list of shapes with index and loops")
    return cases


def solve(case: Case, request: Request) -> Row:
    """Fit one shape, write its program file, and compare. A shape that fails becomes a row that says why."""
    warm(request.grammar, request.method)
    started = time.perf_counter()
    true_primitives = 0
    try:
        truth = true_outline(case)
        true_primitives = truth.simplified(SAME_CURVE).primitives
        fit = _fit(case, truth, request)
    except D4cadError as error:
        wall = time.perf_counter() - started
        return Row(case.set, case.index, 0.0, 0, true_primitives, False, 0.0, wall, "failed", error=str(error))
    exact = fit.psnr >= EXACT and fit.primitives <= true_primitives
    stop = fit.stop.name.lower()
    row = Row(
        set=case.set,
        index=case.index,
        psnr=fit.psnr,
        primitives=fit.primitives,
        true_primitives=true_primitives,
        exact=exact,
        cpu_s=fit.seconds,
        wall_s=fit.wall,
        stop=stop,
        start_psnr=fit.start_psnr,
        start_primitives=fit.start_primitives,
    )
    extra = {
        "set": case.set,
        "index": case.index,
        "true_primitives": true_primitives,
        "exact": exact,
        "start_psnr": fit.start_psnr,
        "start_primitives": fit.start_primitives,
    }
    io.write(request.out / f"{case.name}.json", fit.document(extra=extra))
    if stop == "interrupted":
        raise KeyboardInterrupt
    return row


def _fit(case: Case, truth: Sketch, request: Request) -> Fit:
    how: dict[str, Any] = {
        "method": request.method,
        "grammar": request.grammar,
        "variant": request.variant,
        "seed": request.seed,
        "max_time": request.max_time,
        "init": request.init,
        "snap": request.snap,
    }
    if request.bitmaps is not None:
        return fit_image(request.bitmaps / f"{case.name}.png", **how)
    canvas = Canvas.square(RESOLUTION)
    how["init"] = request.init or "axiom"
    return fit_coverage(coverage(truth, canvas), canvas, **how)


def true_outline(case: Case) -> Sketch:
    """The shape's outline in world units. Raises GeometryError if it bounds no region."""
    return Sketch.from_neutral(case.loops, "world")


def coverage(sketch: Sketch, canvas: Canvas) -> Floats:
    """The outline's raster on ``canvas``, (height, width), row 0 lowest."""
    grammar = ArcLine(canvas.pixel)
    return grammar.rasterize(grammar.drawn(sketch.loops), canvas).coverage


COLUMNS = (
    "set",
    "shapes",
    "exact",
    "psnr mean",
    "median",
    "worst",
    "primitives",
    "true",
    "start dB",
    "start prim.",
    "cpu s median",
    "max",
    "failed",
)


def table(rows: Sequence[Row]) -> str:
    """Results by set and for all: dB, numbers of primitives, CPU seconds; then the shapes that failed."""
    sets = sorted({row.set for row in rows})
    lines = [_line(name, [row for row in rows if row.set == name]) for name in sets]
    if len(sets) > 1:
        lines.append(_line("all", rows))
    cells = [list(COLUMNS), *lines]
    widths = [max(len(line[k]) for line in cells) for k in range(len(COLUMNS))]
    text = ["  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)) for line in cells]
    text += [f"{row.set} {row.index}: {row.error}" for row in rows if row.error is not None]
    return "\n".join(text)


def _line(name: str, rows: Sequence[Row]) -> list[str]:
    done = [row for row in rows if row.error is None]
    failed = str(len(rows) - len(done))
    share = f"{sum(row.exact for row in done) / len(rows):.1%}"
    if not done:
        return [name, str(len(rows)), share, *["-"] * 9, failed]
    psnr = [row.psnr for row in done]
    cpu = [row.cpu_s for row in done]
    numbers = [
        *(f"{f(psnr):.1f}" for f in (fmean, median, min)),
        f"{fmean(row.primitives for row in done):.2f}",
        f"{fmean(row.true_primitives for row in done):.2f}",
        f"{fmean(row.start_psnr for row in done):.1f}",
        f"{fmean(row.start_primitives for row in done):.2f}",
        *(f"{f(cpu):.3f}" for f in (median, max)),
    ]
    return [name, str(len(rows)), share, *numbers, failed]
