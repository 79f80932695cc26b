"""A contact sheet: outlines side by side, each with a line of text."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from d4cad.exporters.preview import require_format, save
from d4cad.files import replacing
from d4cad.sketch import Sketch

TILE, CAPTION = 1.4, 0.36
"""Inches along a tile and below it."""

INK = "#20262c"


def write_sheet(path: str | Path, sketches: Sequence[Sketch], captions: Sequence[str], columns: int = 6) -> None:
    """Write outlines filled, in rows of ``columns``, each as large as its tile allows, as .png or .svg.

    Raises ExportError.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    path = Path(path)
    require_format(path)
    columns = min(columns, len(sketches))
    rows = ceil(len(sketches) / columns)
    size = (columns * TILE, rows * (TILE + CAPTION))
    figure: Any = Figure(figsize=size, facecolor="white")
    for number, (sketch, caption) in enumerate(zip(sketches, captions, strict=True)):
        left, low = number % columns * TILE, size[1] - (number // columns + 1) * (TILE + CAPTION) + CAPTION
        ax = figure.add_axes((left / size[0], low / size[1], TILE / size[0], TILE / size[1]))
        xmin, ymin, xmax, ymax = sketch.bounds
        half = 0.58 * max(xmax - xmin, ymax - ymin)
        x, y = (xmin + xmax) / 2, (ymin + ymax) / 2
        ax.set(xlim=(x - half, x + half), ylim=(y - half, y + half))
        ax.axis("off")
        loops = [np.concatenate(loop.traces(half / 4000)) for loop in sketch.loops]
        outline = Outline.make_compound_path(*(Outline(loop, closed=False) for loop in loops))
        ax.add_patch(PathPatch(outline, facecolor=INK, linewidth=0))
        figure.text(
            (left + TILE / 2) / size[0], (low - 0.05) / size[1], caption, fontsize=7, color=INK, ha="center", va="top"
        )
    with replacing(path) as temporary:
        save(figure, temporary)
