"""Draws the figures of docs/how-it-works.md into docs/images/how/: `python docs/figures.py`.

They show what the paper's figures show, drawn by our code of our own shapes: a descent, the rewrites, three grammars on
one target, the ablations over time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Curve

from d4cad.bench import coverage
from d4cad.canvas import Canvas
from d4cad.descent import Record, descend
from d4cad.edgemodel import exact
from d4cad.errors import GeometryError
from d4cad.fit import decibels
from d4cad.grammars.arc_line import FACTS, ArcLine
from d4cad.objectives.image import ImageLoss
from d4cad.program import Floats, Program, Rewrite
from d4cad.registry import make_grammar, make_method
from d4cad.shapes import generate
from d4cad.sketch import Loop, Sketch
from d4cad.tables.settings import Setting

OUT = Path(__file__).parent / "images" / "how"
CANVAS = Canvas.square(256)
SEED = 21
"""Of the generator's shape that all figures are of."""
SHAPES = (3, 7, 9, 12, 14, 21, 31)
"""Of those that the curves are the median of."""
FILL, STROKE, DOT, OTHER = "#dbe4f3", "#1f3a5f", "#d9622b", "#8a93a3"


@dataclass(frozen=True, slots=True)
class Run:
    """A search: its grammar, the program after every round, and the records."""

    grammar: Any
    programs: list[Program[Any]]
    records: list[Record]
    found: Program[Any]


def target(seed: int = SEED) -> Floats:
    """Coverage of a shape of the generator in the paper's raster."""
    return coverage(generate(np.random.default_rng(seed), 8), CANVAS)


def searched(setting: Setting, goal: Floats, seed: int = 0) -> Run:
    """A search from the axiom."""
    grammar, method = setting.search(CANVAS, goal, exact(goal, CANVAS).floor)
    run = Run(grammar, [], [], grammar.axiom(CANVAS))
    programs, records = run.programs, run.records

    def watch(record: Record, program: Program[Any]) -> None:
        programs.append(program)
        records.append(record)

    start = grammar.axiom(CANVAS)
    found = descend(start, grammar, ImageLoss.of(goal), CANVAS, method, np.random.default_rng(seed), watch)
    return Run(grammar, [start, *programs], records, found.program)


def drawing(axes: Axes, sketch: Sketch, *, dots: bool = True, color: str = STROKE, fill: str | None = FILL) -> None:
    """The outline with its vertices."""
    for face in sketch.faces:
        vertices: list[Any] = []
        codes: list[Any] = []
        for loop in (face.outer, *face.holes):
            points = loop.polygon(0.002)
            vertices += [*points, points[0]]
            codes += [Curve.MOVETO, *[Curve.LINETO] * (len(points) - 1), Curve.CLOSEPOLY]
        patch = PathPatch(Curve(vertices, codes), fc=fill or "none", ec=color, lw=1.1, joinstyle="round")
        axes.add_patch(patch)
    if dots:
        points = np.array([p for loop in sketch.loops for p in loop.points])
        axes.plot(points[:, 0], points[:, 1], "o", color=DOT, ms=2.6, zorder=3)


def bare(axes: Axes, title: str, reach: float = 1.5) -> None:
    """A square panel without scales."""
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_color("#d0d5dd")
    axes.set_title(title, fontsize=8)


def save(figure: Any, name: str) -> None:
    """Write the figure, the same bytes every time."""
    OUT.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context({"svg.hashsalt": "d4cad"}):
        figure.savefig(OUT / f"{name}.svg", metadata={"Date": None})
    plt.close(figure)


def draw_descent() -> None:
    """One search, round by round."""
    goal = target()
    run = searched(Setting("fast", "AL-all"), goal)
    chosen = [0, 1, 2, 3, 5, len(run.programs) - 1]
    figure, panels = plt.subplots(2, 3, figsize=(6.6, 4.8), layout="constrained")
    for axes, k in zip(panels.flat, chosen, strict=True):
        axes.imshow(1 - 0.35 * goal, cmap="gray", vmin=0, vmax=1, origin="lower", extent=(-1.5, 1.5, -1.5, 1.5))
        program = run.programs[k]
        try:
            drawing(axes, run.grammar.outline(program), fill=None)
        except GeometryError:
            continue
        error = float(np.mean((run.grammar.rasterize(program, CANVAS).coverage - goal) ** 2))
        seconds = 0.0 if k == 0 else run.records[k - 1].seconds
        what = "axiom" if k == 0 else f"round {k}"
        bare(axes, f"{what}: {run.grammar.primitives(program)} edges, {decibels(error):.0f} dB, {seconds:.2f} s")
    save(figure, "descent")


def stock() -> Program[Any]:
    """A shape on which every rewrite can be shown."""
    bump = np.tan(np.pi / 8)
    outer = Loop(
        (
            (-1.1, -0.8), (0.2, -0.8), (1.1, -0.8), (1.1, 0.2), (0.9, 0.8), (0.5, 0.8), (-0.25, 0.45), (-0.8, 0.8),
            (-1.1, 0.3),
        ),
        (0.0, 0.04, bump / 2, bump / 2, 0.0, 0.0, 0.0, 0.0, 0.0),
    )  # fmt: skip
    hole = Loop(((0.55, -0.1), (0.35, -0.32), (0.15, -0.1), (0.35, 0.1)), (-0.35,) * 4)
    return ArcLine(CANVAS.pixel).drawn([outer, hole])


SHOWN = (
    "split", "to-arc", "to-line", "merge-line", "merge-arc", "close",
    "add-loop", "remove-loop", "split-lines", "round", "chamfer", "circle",
)  # fmt: skip


def draw_rewrites() -> None:
    """One rewrite of each kind, applied to one shape; before in grey."""
    grammar, base = ArcLine(CANVAS.pixel, lossy=40.0), stock()
    before = grammar.outline(base)
    offered = grammar.rewrites(base, demand(), CANVAS, np.random.default_rng(0))
    figure, panels = plt.subplots(3, 4, figsize=(7.2, 5.4), layout="constrained")
    for axes, rule in zip(panels.flat, SHOWN, strict=True):
        after = shown(rule, base, [r for r in offered if r.rule == rule], grammar)
        drawing(axes, after)
        drawing(axes, before, dots=False, color=OTHER, fill=None)
        bare(axes, rule + (" (shape kept)" if FACTS[rule].exact else ""), reach=1.3)
    save(figure, "rewrites")


def demand() -> Floats:
    """Material asked for in the lower right, and less of it in the upper left."""
    wanted = np.zeros(CANVAS.shape)
    wanted[112:132, 72:92] = -1.0
    return wanted


def shown(rule: str, base: Program[Any], offered: Sequence[Rewrite], grammar: ArcLine) -> Sketch:
    """The outline after the rewrite of a kind that is seen best, of those that leave one."""
    wanted = {
        "to-arc": 4,
        "to-line": 2,
        "merge-line": 6,
        "merge-arc": 3,
        "close": 4,
        "split": 0,
        "round": 0,
        "chamfer": 5,
        "remove-loop": 9,
    }
    at = wanted.get(rule)
    for rewrite in sorted(offered, key=lambda r: at is None or int(r.data[0]) != at):
        try:
            return grammar.outline(grammar.apply(base, [rewrite]).program)
        except GeometryError:
            continue
    raise ValueError(f"the shape shows no {rule}")


def draw_grammars() -> None:
    """One target in three grammars."""
    goal = target()
    figure, panels = plt.subplots(1, 4, figsize=(7.6, 2.2), layout="constrained")
    panels[0].imshow(1 - goal, cmap="gray", vmin=0, vmax=1, origin="lower", extent=(-1.5, 1.5, -1.5, 1.5))
    bare(panels[0], "target")
    names = {"arc-line": "edges", "union-rect": "rectangles", "tree": "nodes"}
    for axes, (name, noun) in zip(panels[1:], names.items(), strict=True):
        grammar: Any = make_grammar(name, "fast", CANVAS, None, goal)
        method = make_method("fast", CANVAS, exact(goal, CANVAS).floor, name)
        start = grammar.axiom(CANVAS)
        found = descend(start, grammar, ImageLoss.of(goal), CANVAS, method, np.random.default_rng(0))
        parts = grammar.rectangles(found.program) if name == "union-rect" else [grammar.outline(found.program)]
        for part in parts:
            drawing(axes, part, dots=name == "arc-line", fill="#dbe4f380")
        error = float(np.mean((grammar.rasterize(found.program, CANVAS).coverage - goal) ** 2))
        bare(axes, f"{name}: {grammar.primitives(found.program)} {noun}, {min(decibels(error), 120):.0f} dB")
    save(figure, "grammars")


def draw_ramps() -> None:
    """Coverage at an edge by three edge models, and the pixels of the band."""
    goal = target()
    figure, panels = plt.subplots(1, 3, figsize=(6.6, 2.4), layout="constrained")
    run = searched(Setting("fast", "AL-all"), goal)
    for axes, (ramp, title) in zip(panels, ((3.0, "3 px"), (2**-0.5, "the paper's"), (0.0, "exact area")), strict=True):
        canvas = Canvas.square(48, ramp)
        drawn = run.grammar.rasterize(run.found, canvas)
        axes.imshow(
            1 - 0.6 * drawn.coverage, cmap="gray", vmin=0, vmax=1, origin="lower", extent=(-1.5, 1.5, -1.5, 1.5)
        )
        drawing(axes, run.grammar.outline(run.found), dots=False, color=DOT, fill=None)
        bare(axes, f"{title}: {len(drawn.row)} px in the band", reach=1.2)
    save(figure, "ramps")


def draw_ablations() -> None:
    """PSNR over time, the median of shapes: both methods, and each without one thing."""
    figure, panels = plt.subplots(1, 2, figsize=(7.2, 2.9), layout="constrained", sharey=True)
    for axes, method, grid in zip(
        panels, ("paper", "fast"), (np.geomspace(0.02, 3, 80), np.geomspace(0.02, 0.6, 80)), strict=True
    ):
        for ablation, color in (("Full", STROKE), ("OneRewrite", DOT), ("NoStep", OTHER)):
            runs = [searched(Setting(method, "AL-F", ablation), target(seed)).records for seed in SHAPES]
            curves = [best_by(grid, run) for run in runs]
            axes.plot(grid, np.median(curves, axis=0), color=color, label=ablation)
        axes.set_xscale("log")
        axes.set_xlabel("seconds")
        axes.set_title(f"--method {method}", fontsize=9)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("PSNR, dB")
    panels[0].legend(frameon=False, fontsize=8)
    save(figure, "ablations")


def best_by(grid: Floats, records: Sequence[Record]) -> Floats:
    """The best PSNR (dB) reached at each of some times, seconds."""
    best = np.maximum.accumulate([0.0, *(record.psnr for record in records)])
    return np.asarray(best[np.searchsorted([record.seconds for record in records], grid, side="right")])


def main() -> None:
    """All figures."""
    mpl.rcParams.update({"font.size": 8, "svg.fonttype": "none"})
    for draw in (draw_descent, draw_rewrites, draw_grammars, draw_ramps, draw_ablations):
        draw()


if __name__ == "__main__":
    main()
