"""The tables as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from d4cad.files import replacing
from d4cad.tables.published import PAPER
from d4cad.tables.sets import TWINS
from d4cad.tables.summing import Cell
from d4cad.tables.writing import families

COLORS = {"paper": "#7a8ba8", "fast": "#d9622b"}
HIDDEN_TIME = 1e-3
"""CPU seconds below which a bar would vanish from a logarithmic axis."""


def plot(out: Path, found: Sequence[Cell]) -> list[Path]:
    """Write psnr.svg and time.svg to the folder: one panel for each grammar and set, a bar for each method, the paper's
    figures as dots. Returns the files' paths. Raises ExportError."""
    return [_panels(out / "psnr.svg", found, timed=False), _panels(out / "time.svg", found, timed=True)]


def _panels(path: Path, found: Sequence[Cell], *, timed: bool) -> Path:
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    sets = list(dict.fromkeys(cell.set for cell in found))
    grammars = families([cell.row for cell in found])
    rows = {g: list(dict.fromkeys(c.row for c in found if c.row.startswith(g))) for g in grammars}
    figure = Figure(
        figsize=(4 * len(sets), 0.9 + sum(0.9 + 0.34 * len(rows[g]) for g in grammars)), layout="constrained"
    )
    FigureCanvasSVG(figure)
    panels = figure.subplots(
        len(grammars), len(sets), squeeze=False, height_ratios=[0.9 + 0.34 * len(rows[g]) for g in grammars]
    )
    methods = list(dict.fromkeys(cell.method for cell in found))
    height = 0.8 / len(methods)
    for line, grammar in zip(panels, grammars, strict=True):
        for panel, name in zip(line, sets, strict=True):
            places = {row: -k for k, row in enumerate(rows[grammar])}
            for k, method in enumerate(methods):
                mine = [c for c in found if c.method == method and c.set == name and c.row in places]
                at = [places[c.row] + 0.4 - height * (k + 0.5) for c in mine]
                if timed:
                    panel.barh(
                        at,
                        [max(c.median_s, HIDDEN_TIME) for c in mine],
                        height,
                        color=COLORS[method],
                        label=f"--method {method}",
                    )
                else:
                    off = [[max(c.mean - c.low, 0) for c in mine], [max(c.high - c.mean, 0) for c in mine]]
                    panel.barh(
                        at, [c.mean for c in mine], height, xerr=off, color=COLORS[method], label=f"--method {method}"
                    )
            published = [(PAPER[row][TWINS.get(name, name)], y) for row, y in places.items()
                         if TWINS.get(name, name) in PAPER.get(row, {})]  # fmt: skip
            dots = [(p.seconds if timed else p.psnr, y) for p, y in published if not timed or p.seconds is not None]
            panel.plot(
                [x for x, _ in dots], [y for _, y in dots], "k|", markersize=11, markeredgewidth=2, label="published"
            )
            panel.set_yticks(list(places.values()), list(places))
            panel.set_title(name)
            if timed:
                panel.set_xscale("log")
            panel.spines[["top", "right"]].set_visible(False)
    for panel in panels[-1]:
        panel.set_xlabel("CPU seconds, median" if timed else "PSNR, dB (mean, 95 %)")
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
    with replacing(path) as temporary, mpl.rc_context({"svg.hashsalt": "d4cad"}):
        figure.savefig(temporary, metadata={"Date": None})
    return path
