"""A picture of a drawing before and after it was simplified."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from d4cad.exporters.preview import ARC, FRAME, INK, LINE, require_format, save
from d4cad.files import replacing
from d4cad.sketch import Sketch

BEFORE = "#9aa7b4"


def write_overlay(path: str | Path, before: Sketch, after: Sketch, title: str) -> None:
    """Writes two panels as PNG or SVG, by the extension: a drawing and, over it, the simplified one.

    Each vertex is a dot; lines and arcs have their colours. Both sketches share a unit. ``title``: one line on top.
    Raises ExportError for another extension or an unwritable file.
    """
    require_format(path)
    from matplotlib.figure import Figure

    xmin, ymin, xmax, ymax = before.bounds
    width, height = xmax - xmin, ymax - ymin
    scale = 5.5 / max(width, height)
    rows, columns = (2, 1) if width > 1.5 * height else (1, 2)
    scale *= 1.5 if rows == 2 else 1.0
    size = (columns * max(width * scale, 1.6) + 0.6, rows * max(height * scale, 0.6) + 0.9)
    figure = Figure(figsize=size, facecolor="white")
    figure.text(0.2 / size[0], 1 - 0.28 / size[1], title, fontsize=11, color=INK, va="center")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True)
    figure.subplots_adjust(left=0.2 / size[0], right=1 - 0.2 / size[0], bottom=0.2 / size[1],
                           top=1 - 0.55 / size[1], wspace=0.04, hspace=0.04)  # fmt: skip
    step = max(width, height) / 4000
    for ax in panels:
        pad = 0.03 * max(width, height)
        ax.set(xlim=(xmin - pad, xmax + pad), ylim=(ymin - pad, ymax + pad), xticks=[], yticks=[], aspect="equal")
        ax.spines[:].set_color(FRAME)
        _draw(ax, before, step, BEFORE if ax is panels[1] else None, dots=ax is panels[0])
    _draw(panels[1], after, step, None, dots=True)
    with replacing(path) as temporary:
        save(figure, temporary)


def _draw(ax: Any, sketch: Sketch, step: float, color: str | None, *, dots: bool) -> None:
    """The edges of a sketch in one colour, or each in that of its kind, and its vertices."""
    from matplotlib.collections import LineCollection

    parts = [part for loop in sketch.loops for part in loop.traces(step)]
    kinds = [ARC if bulge else LINE for loop in sketch.loops for bulge in loop.bulges]
    ax.add_collection(LineCollection(parts, colors=color or kinds, linewidths=2.6 if color else 1.3), autolim=False)
    if dots:
        points = np.array([p for loop in sketch.loops for p in loop.points])
        ax.scatter(
            *points.T, s=12.0 if len(points) < 150 else 4.0, facecolor="white", edgecolor=INK, linewidth=0.7, zorder=3
        )
