"""The paper's Figure 3: RJMCMC, Tr-1 and Tr-5 on the same shapes in the same wall time, by the paper's settings.

    python benchmarks/rjmcmc.py [--seconds 20] [--shapes 1] [--seeds 1] [--data DIR] [--out docs/results]

Writes rjmcmc.json, rjmcmc.md and rjmcmc.svg. The two variants of SRD go on until the time is over: their patience is
without limit here. The best loss so far counts for all.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from d4cad.baselines.trees import anneal
from d4cad.bench import RESOLUTION, Case, coverage, shapes, true_outline
from d4cad.canvas import Canvas
from d4cad.descent import Record, descend
from d4cad.edgemodel import exact
from d4cad.fit import decibels
from d4cad.fitting import warm
from d4cad.objectives.image import ImageLoss
from d4cad.registry import make_grammar
from d4cad.tables.sets import cases
from d4cad.tables.settings import Setting

METHODS = ("RJMCMC", "Tr-1", "Tr-5")
COLORS = {"RJMCMC": "#7a8ba8", "Tr-1": "#3a6ea5", "Tr-5": "#d9622b"}
PUBLISHED = {"RJMCMC": "15.3 dB, 219 min", "Tr-1": "20.0 dB, 19 min", "Tr-5": "31.3 dB, 99 min"}


def solved(method: str, case: Case, seed: int, seconds: float) -> list[tuple[float, float, int]]:
    """(seconds, best PSNR in dB so far, nodes) of a run."""
    canvas = Canvas.square(RESOLUTION)
    target = coverage(true_outline(case), canvas)
    rng = np.random.default_rng(seed)
    if method == "RJMCMC":
        # Of Tr-1 it has the trees: leaves of one size, the root at the bottom of the shape.
        tree: Any = make_grammar("tree", "paper", canvas, "Tr-1", target)
        history = anneal(target, canvas, tree, rng, seconds=seconds).history
        return [(r.seconds, r.psnr, r.primitives) for r in history]
    warm("tree", "paper")
    grammar, settings = Setting("paper", method).search(canvas, target, exact(target, canvas).floor)
    stage = replace(settings.stages[0], rounds=10**9, patience=10**9)
    records: list[Record] = []
    descend(
        grammar.axiom(canvas), grammar, ImageLoss.of(target), canvas, replace(settings, stages=(stage,)), rng,
        lambda record, program: records.append(record), seconds,
    )  # fmt: skip
    start = grammar.axiom(canvas)
    best = decibels(ImageLoss.of(target).value(grammar.rasterize(start, canvas)))
    found = [(0.0, best, grammar.primitives(start))]
    for record in records:
        if record.psnr > best:
            best = record.psnr
            found.append((record.seconds, record.psnr, record.primitives))
    return found


def plot(path: Path, runs: dict[str, list[list[tuple[float, float, int]]]], seconds: float) -> None:
    """PSNR over time: every run thin, the mean thick."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 3.4), layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.subplots()
    grid = np.geomspace(0.05, seconds, 120)
    for method, found in runs.items():
        curves = []
        for run in found:
            times, best = [t for t, *_ in run], np.array([0.0, *(p for _, p, _ in run)])
            curves.append(best[np.searchsorted(times, grid, side="right")])
            axes.plot(grid, curves[-1], color=COLORS[method], lw=0.5, alpha=0.6)
        axes.plot(grid, np.mean(curves, axis=0), color=COLORS[method], lw=2, label=method)
    axes.set_xscale("log")
    axes.set_xlabel("wall seconds")
    axes.set_ylabel("PSNR of the best so far, dB")
    axes.set_ylim(bottom=8)
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    with mpl.rc_context({"svg.hashsalt": "d4cad"}):
        figure.savefig(path, metadata={"Date": None})


def main() -> None:
    """Run, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--shapes", type=int, default=1, help="of each set")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--data", type=Path, help="folder of {set}.json files; else our own three sets")
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    given = parser.parse_args()
    wanted = cases(given.shapes) if given.data is None else shapes(given.data, given.shapes)
    runs: dict[str, list[list[tuple[float, float, int]]]] = {method: [] for method in METHODS}
    rows = []
    for case in wanted:
        for seed in range(given.seeds):
            for method in METHODS:
                started = time.perf_counter()
                run = solved(method, case, seed, given.seconds)
                runs[method].append(run)
                last = run[-1]
                rows.append({"set": case.set, "index": case.index, "seed": seed, "method": method, "psnr": last[1],
                             "nodes": last[2], "seconds": time.perf_counter() - started})  # fmt: skip
                print(f"{case.name} seed {seed} {method}: {last[1]:.1f} dB, {last[2]} nodes", flush=True)
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "rjmcmc.json").write_text(json.dumps({"seconds": given.seconds, "rows": rows, "runs": runs}) + "\n")
    lines = [
        "# RJMCMC beside SRD", "",
        f"`python benchmarks/rjmcmc.py --seconds {given.seconds:g} --shapes {given.shapes} --seeds {given.seeds}`: "
        f"{len(wanted) * given.seeds} runs a method, each of {given.seconds:g} s on one core of a busy machine.",
        "", "| | mean PSNR dB | by set | nodes | the paper (its own shape and machine) |", "|---|---|---|---|---|",
    ]  # fmt: skip
    for method in METHODS:
        mine = [row for row in rows if row["method"] == method]
        sets = dict.fromkeys(str(row["set"]) for row in mine)
        by_set = ", ".join(f"{name} {fmean(row['psnr'] for row in mine if row['set'] == name):.1f}" for name in sets)
        nodes = fmean(row["nodes"] for row in mine)
        lines.append(
            f"| {method} | {fmean(row['psnr'] for row in mine):.1f} | {by_set} | {nodes:.0f} | {PUBLISHED[method]} |"
        )
    text = "\n".join(lines) + "\n\n![PSNR over time](rjmcmc.svg)\n"
    (given.out / "rjmcmc.md").write_text(text)
    plot(given.out / "rjmcmc.svg", runs, given.seconds)
    print(text)


if __name__ == "__main__":
    main()
