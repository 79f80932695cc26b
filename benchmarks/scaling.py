"""CPU time against resolution, primitives and proposals a round, with the slopes of the logarithms, and where it goes.

    python benchmarks/scaling.py [--quick] [--out docs/results]

Writes scaling.json, scaling.md and scaling.svg. Times are process time on one core, the least of a few repetitions.
"""

from __future__ import annotations

import argparse
import cProfile
import json
import pstats
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from d4cad.bench import coverage
from d4cad.canvas import Canvas
from d4cad.edgemodel import exact
from d4cad.fitting import fit_coverage, warm
from d4cad.grammars.arc_line import ArcLine
from d4cad.methods import fast
from d4cad.objectives.image import ImageLoss
from d4cad.program import Program
from d4cad.shapes import generate
from d4cad.sketch import Loop, Sketch

RESOLUTIONS = (64, 128, 256, 512, 1024, 2048)
PRIMITIVES = (4, 12, 40, 120, 400)
PROPOSALS = (16, 64, 256, 1024)
MIDDLE = 40
"""Primitives where another thing is varied."""


@dataclass(frozen=True, slots=True)
class Setup:
    """A shape on a canvas: its target, and a program near it with its loss."""

    canvas: Canvas
    grammar: ArcLine
    loss: ImageLoss
    program: Program[Any]
    target: Any


def wheel(count: int) -> Sketch:
    """A wheel with ``count`` lines and arcs along its rim, half of each, and no other curve."""
    angle = np.arange(count) * 2 * np.pi / count
    radius = np.where(np.arange(count) % 4 < 2, 1.2, 1.05) if count > 8 else np.full(count, 1.1)
    points = tuple((float(r * np.cos(a)), float(r * np.sin(a))) for r, a in zip(radius, angle, strict=True))
    bulge = float(np.tan(np.pi / count / 2)) * 1.3
    return Sketch.from_loops([Loop(points, tuple(bulge if k % 2 else 0.0 for k in range(count)))])


def setup(size: int, count: int) -> Setup:
    """A wheel of ``count`` primitives on size x size pixels, its program a tenth of a pixel beside the target."""
    canvas = Canvas.square(size)
    grammar = ArcLine(canvas.pixel)
    shape = wheel(count)
    target = coverage(shape, canvas)
    program = grammar.drawn(shape.loops)
    off = np.random.default_rng(0).normal(0, 0.1 * canvas.pixel, program.params.size)
    return Setup(canvas, grammar, ImageLoss.of(target), program.moved(program.params + off), target)


def timed(run: Callable[[], Any], budget: float = 0.4) -> float:
    """Process seconds of a call, the least of as many as fit in the budget, one at least; one to warm up is not
    counted."""
    run()
    best, started = np.inf, time.process_time()
    while time.process_time() - started < budget or best == np.inf:
        begin = time.process_time()
        run()
        best = min(best, time.process_time() - begin)
    return float(best)


def evaluation(at: Setup) -> Callable[[], Any]:
    """Value, gradient and Gauss-Newton matrix."""
    return lambda: at.loss.evaluate(at.grammar.rasterize(at.program, at.canvas))


def step(at: Setup) -> Callable[[], Any]:
    """A Levenberg-Marquardt step with its evaluation."""
    stepper = fast(at.canvas).stepper

    def run() -> Any:
        state = stepper.init(at.program)
        return stepper.step(at.program, at.loss.evaluate(at.grammar.rasterize(at.program, at.canvas)), state)

    return run


def trials(at: Setup, count: int | None = None) -> tuple[Callable[[], Any], int]:
    """A round's proposals, each fitted locally, and their number; ``count`` of them with repetition if given."""
    demand = at.loss.demand(at.grammar.rasterize(at.program, at.canvas))
    offered = at.grammar.rewrites(at.program, demand, at.canvas, np.random.default_rng(0))
    offered = [
        rewrite for rewrite in offered if rewrite.rule in ("split", "to-arc", "to-line", "merge-line", "merge-arc")
    ]
    chosen = offered if count is None else [offered[k % len(offered)] for k in range(count)]
    price = 0.65 / at.canvas.size
    return lambda: at.grammar.local_trials(at.program, chosen, at.loss, at.canvas, price, 4), len(chosen)


def fit(size: int, count: int) -> Callable[[], Any]:
    """A whole fit from the traced contour."""
    canvas = Canvas.square(size)
    target = coverage(wheel(count), canvas)
    return lambda: fit_coverage(target, canvas, init="contour", snap=False)


def slope(x: Sequence[float], y: Sequence[float]) -> float:
    """Least squares slope of log y over log x, the upper half of the points: what holds for large ones."""
    half = len(x) // 2
    return float(np.polyfit(np.log(x[half:]), np.log(y[half:]), 1)[0])


def profile(seed: int = 3) -> tuple[list[tuple[str, float]], float]:
    """Shares of a fit's time by function, largest first, and its CPU seconds; from the diamond, 40 primitives."""
    canvas = Canvas.square(256)
    target = coverage(generate(np.random.default_rng(seed), MIDDLE), canvas)
    floor = exact(target, canvas).floor
    fit_coverage(target, canvas, init="axiom", floor=floor, snap=False)
    profiler = cProfile.Profile(time.process_time)
    profiler.enable()
    fit_coverage(target, canvas, init="axiom", floor=floor, snap=False)
    profiler.disable()
    stats: Any = pstats.Stats(profiler)
    total = stats.total_tt
    own = [
        (f"{Path(file).stem}.{name}" if file != "~" else name.strip("<>"), seconds / total)
        for (file, _, name), (_, _, seconds, _, _) in stats.stats.items()
    ]
    return sorted(own, key=lambda item: -item[1])[:12], total


def plot(path: Path, series: dict[str, dict[str, list[tuple[float, float]]]]) -> None:
    """A panel for each thing that is varied, a line for each that is timed."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3), layout="constrained")
    FigureCanvasSVG(figure)
    for axes, (varied, lines) in zip(figure.subplots(1, len(series)), series.items(), strict=True):
        for name, points in lines.items():
            axes.plot([x for x, _ in points], [1e3 * y for _, y in points], "o-", ms=3, label=name)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel(varied)
        axes.legend(frameon=False, fontsize=7)
        axes.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylabel("CPU ms")
    with mpl.rc_context({"svg.hashsalt": "d4cad"}):
        figure.savefig(path, metadata={"Date": None})


def main() -> None:
    """Time all and write it down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="the smallest of everything only")
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    given = parser.parse_args()
    few = 3 if given.quick else None
    warm("arc-line", "fast")
    by_size: dict[str, list[tuple[float, float]]] = {"evaluation": [], "step": [], "round of proposals": [], "fit": []}
    for size in RESOLUTIONS[:few]:
        at = setup(size, MIDDLE)
        for name, run in (("evaluation", evaluation(at)), ("step", step(at)), ("round of proposals", trials(at)[0])):
            by_size[name].append((size, timed(run)))
        by_size["fit"].append((size, timed(fit(size, 12))))
        print(f"{size} px:", *(f"{name} {1e3 * points[-1][1]:.2f} ms," for name, points in by_size.items()), flush=True)
    by_count: dict[str, list[tuple[float, float]]] = {name: [] for name in by_size}
    for count in PRIMITIVES[:few]:
        at = setup(1024, count)
        for name, run in (("evaluation", evaluation(at)), ("step", step(at)), ("round of proposals", trials(at)[0])):
            by_count[name].append((count, timed(run)))
        by_count["fit"].append((count, timed(fit(1024, count))))
        print(
            f"{count} primitives:",
            *(f"{name} {1e3 * points[-1][1]:.2f} ms," for name, points in by_count.items()), flush=True,
        )  # fmt: skip
    at = setup(256, MIDDLE)
    by_proposals = {"round": [(float(n), timed(trials(at, n)[0])) for n in PROPOSALS[:few]]}
    series = {"pixels along a side": by_size, "primitives, 1024x1024": by_count, "proposals a round": by_proposals}
    shares, total = profile()
    lines = [
        "# Scaling", "",
        "`python benchmarks/scaling.py`: CPU time on one core of a busy machine, in ms; wheels of lines and"
        f" arcs. By resolution the program has {MIDDLE} primitives (a fit 12), by primitives the canvas is 1024x1024. A"
        " fit starts from the traced contour."
        " *Slope*: of log time over log size, least squares over the upper half.", "",
    ]  # fmt: skip
    for varied, found in series.items():
        sizes = [x for x, _ in next(iter(found.values()))]
        lines += [f"| {varied} | {' | '.join(f'{x:g}' for x in sizes)} | slope |", "|---" * (len(sizes) + 2) + "|"]
        for name, points in found.items():
            times = [y for _, y in points]
            cells = " | ".join(f"{1e3 * y:.3g}" for y in times)
            lines.append(f"| {name} | {cells} | {slope(sizes, times):.2f} |")
        lines.append("")
    lines += [
        "A trial ends early where its rewrite cannot pay, so that a round's time hangs more on the shape than on its"
        " size. An evaluation costs the boundary's pixels, not the canvas' (slope 1, not 2); a fit's slope with"
        " resolution is that of reading the picture. With hundreds of primitives the dense Cholesky factors of a step"
        " begin to count.", "",
        f"Where the time of a fit of {MIDDLE} primitives goes (256x256, from the diamond, {total:.2f} CPU s under the"
        " profiler, which makes Python's part seem larger), own time:",
        "", "| function | share |", "|---|---|", *(f"| `{name}` | {share:.1%} |" for name, share in shares), "",
        "![CPU time against size](scaling.svg)",
    ]  # fmt: skip
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "scaling.md").write_text("\n".join(lines) + "\n")
    (given.out / "scaling.json").write_text(json.dumps({"series": series, "profile": shares}) + "\n")
    plot(given.out / "scaling.svg", series)
    print("\n".join(lines))


if __name__ == "__main__":
    main()
