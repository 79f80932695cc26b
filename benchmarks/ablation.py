"""What each change of ours to the paper's search buys: `--method fast` with one thing put back at a time.

    python benchmarks/ablation.py [--shapes 2] [--hard 4] [--seconds 5] [--work out/ablation] [--out docs/results]

Shapes of our own three sets, and harder ones of about 40 primitives, from the diamond, in the paper's raster. Every fit
is kept in --work and not done again. Writes ablation.json, ablation.md, ablation_evaluations.svg and
ablation_time.svg. An evaluation is one raster of the whole canvas or one trial of a rewrite, which takes at most four
steps in a small window.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from statistics import fmean, median
from typing import Any

import numpy as np

from d4cad.bench import EXACT, RESOLUTION, SAME_CURVE, Case, coverage, true_outline
from d4cad.canvas import Canvas
from d4cad.descent import Method, Record, descend
from d4cad.edgemodel import exact, measured
from d4cad.estimators import Stepped
from d4cad.fit import decibels
from d4cad.fitting import warm
from d4cad.grammars.arc_line import ArcLine, Structure, sagitta_metric
from d4cad.grammars.arc_line.places import UniformPlaces
from d4cad.methods import fast
from d4cad.objectives.image import ImageLoss
from d4cad.program import Edit, Floats, Program, Rewrite
from d4cad.protocols import Trial
from d4cad.raster.band import Band
from d4cad.registry import PAPER_RULES
from d4cad.shapes import generate
from d4cad.steppers import Adam, ClippedGradient, LevenbergMarquardt, Moments
from d4cad.tables.sets import cases


@dataclass(slots=True)
class Count:
    """Rasters of the whole canvas, and trials of rewrites."""

    rasters: int = 0
    trials: int = 0


@dataclass(frozen=True, slots=True)
class Counted(ArcLine):
    """The grammar, which counts what it is asked; ``mends`` False leaves crossings as they are."""

    count: Count = field(default_factory=Count)
    mends: bool = True

    def rasterize(self, program: Program[Structure], canvas: Canvas) -> Band:
        """Counted."""
        self.count.rasters += 1
        return ArcLine.rasterize(self, program, canvas)

    def local_trials(
        self, program: Program[Structure], rewrites: Sequence[Rewrite], loss: Any, canvas: Canvas, price: float,
        steps: int,
    ) -> list[Trial]:  # fmt: skip
        """Counted."""
        self.count.trials += len(rewrites)
        return ArcLine.local_trials(self, program, rewrites, loss, canvas, price, steps)

    def repair(self, program: Program[Structure]) -> Edit[Structure]:
        """Nothing, if it does not mend."""
        return ArcLine.repair(self, program) if self.mends else Edit(program, np.arange(program.params.size))


@dataclass(frozen=True, slots=True)
class Forgetful(Adam):
    """Adam as the paper has its optimiser: new at every rewrite and repair."""

    def carry(self, state: Moments, edit: Edit[Any]) -> Moments:
        """A fresh state."""
        return self.init(edit.program)


@dataclass(frozen=True, slots=True)
class Unfair(Stepped):
    """Trials that take a step compared with a base that takes none."""

    def estimate(
        self, program: Program[Any], rewrites: Sequence[Rewrite], grammar: Any, loss: Any, canvas: Canvas, price: float
    ) -> list[Trial]:
        """The stepped trials' gains, and what the base's own step gains on top."""
        fair = Stepped.estimate(self, program, rewrites, grammar, loss, canvas, price)
        here = loss.value(grammar.rasterize(program, canvas)) + price * grammar.complexity(program)
        gain = here - self._total(program, grammar, loss, canvas, price)
        return [Trial(trial.rewrite, trial.gain + gain) for trial in fair]


def gradient(method: Method, stepper: Any) -> Method:
    """Another stepper, with four times the steps."""
    return replace(method, stepper=stepper, rhythm=tuple(4 * steps for steps in method.rhythm))


SGD = ClippedGradient(metric=sagitta_metric)
WHOLE = LevenbergMarquardt()

Change = Callable[[Method, Counted], tuple[Method, Counted]]
CHANGES: dict[str, tuple[str, Change]] = {
    "full": ("the default method", lambda m, g: (m, g)),
    "SGD": ("the paper's clipped gradient in place of Levenberg-Marquardt", lambda m, g: (gradient(m, SGD), g)),
    "Adam": ("Adam, its moments carried through rewrites", lambda m, g: (gradient(m, Adam(0.003)), g)),
    "Adam, forgotten": ("Adam, new at every rewrite", lambda m, g: (gradient(m, Forgetful(0.003)), g)),
    "one width": (
        "no wide ramp at the start",
        lambda m, g: (replace(m, stages=tuple(s for s in m.stages if s.ramp == m.stages[-1].ramp)), g),
    ),
    "uniform places": (
        "new loops at random places, as the paper has them",
        lambda m, g: (m, replace(g, places=UniformPlaces())),
    ),
    "sampled": (
        "64 proposals a round drawn at random, a quarter of them new loops",
        lambda m, g: (replace(m, sample=64, reserved=(("add-loop", 0.25),)), g),
    ),
    "whole trials": (
        "64 proposals, each tried by one step of the whole program, as the base",
        lambda m, g: (replace(m, sample=64, reserved=(("add-loop", 0.25),), estimator=Stepped(WHOLE, 1)), g),
    ),
    "whole trials, base as it is": (
        "the same, the base compared without a step",
        lambda m, g: (replace(m, sample=64, reserved=(("add-loop", 0.25),), estimator=Unfair(WHOLE, 1)), g),
    ),
    "price stays high": (
        "the first price of a primitive only",
        lambda m, g: (replace(m, stages=m.stages[:2]), g),
    ),
    "price low at once": (
        "the last price of a primitive only",
        lambda m, g: (replace(m, stages=(replace(m.stages[0], price=m.stages[-1].price), m.stages[-1])), g),
    ),
    "no re-check": ("chosen sets are kept without a look", lambda m, g: (replace(m, recheck=False), g)),
    "one rewrite": ("only the best rewrite of a round", lambda m, g: (replace(m, accept=1), g)),
    "no repair": ("crossings stay", lambda m, g: (m, replace(g, mends=False))),
    "no new rules": (
        "only the paper's kinds of rewrites",
        lambda m, g: (m, replace(g, rules=frozenset(PAPER_RULES))),
    ),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Run:
    """One fit. points: (seconds, evaluations, best PSNR in dB so far) after every round."""

    set: str
    index: int
    name: str
    psnr: float
    primitives: int
    true_primitives: int
    seconds: float
    rasters: int
    trials: int
    points: list[tuple[float, int, float]]

    @property
    def exact(self) -> bool:
        """80 dB with no more primitives than the truth."""
        return self.psnr >= EXACT and self.primitives <= self.true_primitives


def hard(index: int) -> Case:
    """A shape of about 40 primitives."""
    return Case("forty", index, generate(np.random.default_rng(100 + index), 40).to_neutral())


def solved(case: Case, name: str, seconds: float) -> Run:
    """A fit by the method with one thing changed."""
    canvas = Canvas.square(RESOLUTION)
    truth = true_outline(case)
    target = coverage(truth, canvas)
    method, grammar = CHANGES[name][1](fast(canvas, exact(target, canvas).floor), Counted(canvas.pixel))
    return fitted(case, name, method, grammar, target, target, truth.simplified(SAME_CURVE).primitives, seconds)


def priced(case: Case, name: str, noise: float, seconds: float) -> Run:
    """A fit of a picture with noise, at the price that its noise sets or at that of a clean one."""
    canvas = Canvas.square(RESOLUTION)
    truth = true_outline(case)
    clean = coverage(truth, canvas)
    noisy = np.clip(clean + np.random.default_rng(case.index).normal(0, noise, clean.shape), 0, 1)
    deviation = float(np.std((noisy - clean)[(clean == 0) | (clean == 1)])) / 0.58  # clipping halves it there
    floor = measured(noisy, deviation).floor if name == "price by noise" else exact(clean, canvas).floor
    method = fast(canvas, floor)
    count = truth.simplified(SAME_CURVE).primitives
    return fitted(case, name, method, Counted(canvas.pixel), noisy, clean, count, seconds)


def fitted(
    case: Case, name: str, method: Method, grammar: Counted, target: Floats, clean: Floats, count: int, seconds: float
) -> Run:
    """The fit, with what was reached by when."""
    canvas = Canvas.square(RESOLUTION)
    points: list[tuple[float, int, float]] = []

    def psnr(program: Program[Any]) -> float:
        return min(decibels(float(np.mean((ArcLine.rasterize(grammar, program, canvas).coverage - clean) ** 2))), 120.0)

    def watch(record: Record, program: Program[Any]) -> None:
        best = max(psnr(program), points[-1][2] if points else 0.0)
        points.append((record.seconds, grammar.count.rasters + grammar.count.trials, best))

    start = grammar.axiom(canvas)
    found = descend(
        start, grammar, ImageLoss.of(target), canvas, method, np.random.default_rng(0), watch, seconds
    )  # fmt: skip
    last = psnr(found.program)
    end = (points[-1][0], grammar.count.rasters + grammar.count.trials, last) if points else (seconds, 0, last)
    return Run(case.set, case.index, name, last, grammar.primitives(found.program), count, end[0],
               grammar.count.rasters, grammar.count.trials, [*points, end])  # fmt: skip


def kept(path: Path, make: Callable[[], Run]) -> Run:
    """The run in the file, or a new one, which is then kept there."""
    if path.is_file():
        return Run(**json.loads(path.read_text()))
    run = make()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(asdict(run)) + "\n")
    return run


def row(name: str, words: str, runs: Sequence[Run]) -> str:
    """A line of the table."""
    psnr = [run.psnr for run in runs]
    return (
        f"| {name} | {words} | {sum(run.exact for run in runs) / len(runs):.0%}"
        f" | {fmean(psnr):.1f} | {median(psnr):.1f} |"
        f" {min(psnr):.1f} | {fmean(run.primitives / run.true_primitives for run in runs):.2f} |"
        f" {median(run.seconds for run in runs):.2f} | {median(run.rasters for run in runs):.0f} |"
        f" {median(run.trials for run in runs):.0f} |"
    )


HEAD = [
    "| | what is different | exact | mean dB | median | worst | primitives / true | s, median | rasters | trials |",
    "|---|---|---|---|---|---|---|---|---|---|",
]


def plot(path: Path, runs: dict[str, list[Run]], column: int, label: str) -> None:
    """Mean over the shapes of the best PSNR so far, against seconds or evaluations, in two panels."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 3.6), layout="constrained")
    FigureCanvasSVG(figure)
    names = [name for name in runs if name != "full"]
    half = (len(names) + 1) // 2
    panels = figure.subplots(1, 2, sharey=True)
    colors = mpl.colormaps["tab10"]
    longest = max(run.points[-1][column] for found in runs.values() for run in found)
    first = min(run.points[0][column] for found in runs.values() for run in found)
    grid = np.geomspace(max(first, 1e-3), longest, 150)
    for axes, part in zip(panels, (names[:half], names[half:]), strict=True):
        for k, name in enumerate(("full", *part)):
            curves = []
            for run in runs[name]:
                at = [point[column] for point in run.points]
                best = np.array([7.0, *(point[2] for point in run.points)])
                curves.append(best[np.searchsorted(at, grid, side="right")])
            style = {"color": "black", "lw": 2.0} if name == "full" else {"color": colors(k - 1), "lw": 1.1}
            axes.plot(grid, np.mean(curves, axis=0), label=name, **style)
        axes.set_xscale("log")
        axes.set_xlabel(label)
        axes.legend(frameon=False, fontsize=7)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("PSNR of the best so far, dB, at most 120")
    with mpl.rc_context({"svg.hashsalt": "d4cad"}):
        figure.savefig(path, metadata={"Date": None})


def main() -> None:
    """Run what is missing and write all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shapes", type=int, default=2, help="of each set")
    parser.add_argument("--hard", type=int, default=4, help="shapes of about 40 primitives")
    parser.add_argument("--seconds", type=float, default=5.0, help="for each fit")
    parser.add_argument("--noise", type=float, default=0.1)
    parser.add_argument("--work", type=Path, default=Path("out/ablation"))
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    given = parser.parse_args()
    warm("arc-line", "fast")
    wanted = [*cases(given.shapes), *(hard(index) for index in range(given.hard))]
    runs: dict[str, list[Run]] = {}
    for name in CHANGES:
        folder = given.work / name.replace(" ", "_").replace(",", "")
        runs[name] = [
            kept(
                folder / f"{case.name}_{given.seconds:g}.json",
                lambda case=case, name=name: solved(case, name, given.seconds),
            )
            for case in wanted
        ]
        print(row(name, CHANGES[name][0], runs[name]), flush=True)
    noisy = {
        name: [
            kept(
                given.work / name.replace(" ", "_") / f"{case.name}_{given.noise:g}.json",
                lambda case=case, name=name: priced(case, name, given.noise, given.seconds),
            )
            for case in wanted
        ]
        for name in ("price by noise", "price of a clean picture")
    }
    given.out.mkdir(parents=True, exist_ok=True)
    lines = [
        "# What each change buys", "",
        f"`python benchmarks/ablation.py --shapes {given.shapes} --hard {given.hard} --seconds {given.seconds:g}`:"
        f" {len(wanted)} shapes of our own, {given.hard} of them of about 40 primitives, from the diamond, in the"
        f" paper's 256x256 raster, at most {given.seconds:g} s each on one core of a busy machine; dB up to 120."
        " *Exact*: at least 80 dB with no more primitives than the truth.",
        "", *HEAD, *(row(name, CHANGES[name][0], found) for name, found in runs.items()), "",
        f"With noise of {given.noise:g} on every pixel, dB against the clean picture:", "", *HEAD,
        *(row(name, "", found) for name, found in noisy.items()), "",
        "![PSNR against evaluations](ablation_evaluations.svg)", "", "![PSNR against time](ablation_time.svg)",
    ]  # fmt: skip
    (given.out / "ablation.md").write_text("\n".join(lines) + "\n")
    facts = {name: [{k: v for k, v in asdict(run).items() if k != "points"} for run in found]
             for name, found in (runs | noisy).items()}  # fmt: skip
    (given.out / "ablation.json").write_text(json.dumps(facts) + "\n")
    plot(given.out / "ablation_evaluations.svg", runs, 1, "evaluations")
    plot(given.out / "ablation_time.svg", runs, 0, "seconds")


if __name__ == "__main__":
    main()
