"""One picture to judge a fit by: target, outline with its vertices, error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from d4cad.canvas import Canvas
from d4cad.edges import Floats
from d4cad.errors import ExportError, InputError
from d4cad.files import replacing
from d4cad.sketch import Sketch

FORMATS = (".png", ".svg")

INK, LINE, ARC, FRAME = "#1c2733", "#1d5fa8", "#d1495b", "#b8c2cc"


def write_preview(
    path: str | Path, sketch: Sketch, canvas: Canvas, target: Floats, coverage: Floats, title: str
) -> None:
    """Writes three panels as PNG or SVG, by the extension: target, outline with vertices, error map.

    ``sketch``: in world units. ``target``, ``coverage``: (H, W) of the canvas, row 0 lowest, 1 inside.
    ``title``: one line on top. The error is coverage - target: red where the part has too much, blue too little.
    Raises ExportError for another extension or an unwritable file, InputError for arrays of another shape.
    """
    require_format(path)
    for name, array in (("target", target), ("coverage", coverage)):
        if array.shape != canvas.shape:
            raise InputError(f"the preview's {name} must have the canvas's shape {canvas.shape}, got {array.shape}")
    figure = _figure(sketch, canvas, target, coverage, title)
    with replacing(path) as temporary:
        save(figure, temporary)


def require_format(path: str | Path) -> None:
    """Raises ExportError unless a preview can have the extension of ``path``."""
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise ExportError(f"cannot write {path}: a preview is {' or '.join(FORMATS)}, got {suffix or 'no extension'}")


def _figure(sketch: Sketch, canvas: Canvas, target: Floats, coverage: Floats, title: str) -> Any:
    error = coverage - target
    worst = float(np.max(np.abs(error)))
    figure, panels, bar = _layout(canvas, title)
    x, y = canvas.extent
    how: dict[str, Any] = {"origin": "lower", "extent": (-x, x, -y, y), "interpolation": "nearest"}
    panels[0].imshow(1 - target, cmap="gray", vmin=0, vmax=1, **how)
    _label(panels[0], [("target", INK)])
    panels[1].imshow(1 - target, cmap="gray", vmin=-5, vmax=1, **how)
    _draw(panels[1], sketch, canvas)
    arcs = sum(b != 0 for loop in sketch.loops for b in loop.bulges)
    _label(panels[1], [(_counted(sketch.primitives - arcs, "line"), LINE), (_counted(arcs, "arc"), ARC)])
    scale = max(worst, 1e-3)
    shown = panels[2].imshow(error, cmap="RdBu_r", vmin=-scale, vmax=scale, **how)
    _label(panels[2], [(f"error, at most {worst:.2g}", INK)])
    figure.colorbar(shown, cax=bar, ticks=[-scale, 0, scale])
    bar.set_yticklabels([f"{-scale:.2g}", "0", f"{scale:.2g}"], fontsize=8, color=INK)
    return figure


def _layout(canvas: Canvas, title: str) -> tuple[Any, list[Any], Any]:
    """A figure with three panels of the canvas's proportions and a colour bar beside them, all placed in inches."""
    from matplotlib.figure import Figure  # not pyplot: no global state, no display

    x, y = canvas.extent
    width, height = max(4.0 * x / max(x, y), 0.1), max(4.0 * y / max(x, y), 0.1)
    column, margin, head = max(width, 1.9), 0.2, 0.85
    total = (3 * column + 4 * margin + 0.7, height + head + margin)
    figure = Figure(figsize=total, facecolor="white")
    figure.text(margin / total[0], 1 - 0.3 / total[1], title, fontsize=12, color=INK, va="center")
    panels = []
    for k in range(3):
        left = margin + k * (column + margin) + (column - width) / 2
        ax = figure.add_axes((left / total[0], margin / total[1], width / total[0], height / total[1]))
        ax.set(xlim=(-x, x), ylim=(-y, y), xticks=[], yticks=[])
        ax.spines[:].set_color(FRAME)
        panels.append(ax)
    left = 3 * (column + margin) - (column - width) / 2 + 0.1
    bar = figure.add_axes((left / total[0], margin / total[1], 0.12 / total[0], height / total[1]))
    return figure, panels, bar


def _label(ax: Any, words: list[tuple[str, str]]) -> None:
    """Words in their colours, side by side above the panel's left corner."""
    from matplotlib.offsetbox import AnchoredOffsetbox, HPacker, TextArea

    texts: list[Any] = [TextArea(text, textprops={"color": color, "size": 10}) for text, color in words]
    row = HPacker(children=texts, pad=0, sep=8)
    ax.add_artist(
        AnchoredOffsetbox("lower left", child=row, pad=0, frameon=False, borderpad=0.3,
                          bbox_to_anchor=(0, 1), bbox_transform=ax.transAxes)
    )  # fmt: skip


def _counted(n: int, noun: str) -> str:
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def _draw(ax: Any, sketch: Sketch, canvas: Canvas) -> None:
    """Edges coloured by kind, and a dot at every vertex."""
    from matplotlib.collections import LineCollection

    curves: dict[str, list[Floats]] = {LINE: [], ARC: []}
    for loop in sketch.loops:
        for part, bulge in zip(loop.traces(canvas.pixel / 20), loop.bulges, strict=True):
            curves[ARC if bulge else LINE].append(part)
    for color, parts in curves.items():
        ax.add_collection(LineCollection(parts, colors=color, linewidths=1.6, capstyle="round"), autolim=False)
    points = np.array([p for loop in sketch.loops for p in loop.points]).reshape(-1, 2)
    size = 14.0 if len(points) < 150 else 5.0
    ax.scatter(points[:, 0], points[:, 1], s=size, facecolor="white", edgecolor=INK, linewidth=0.8, zorder=3)


def save(figure: Any, path: Path) -> None:
    """Saves without a date and with fixed element ids, so that the same fit is the same file."""
    import matplotlib

    vector = path.suffix.lower() == ".svg"
    with matplotlib.rc_context({"svg.hashsalt": "d4cad", "svg.fonttype": "path"}):
        figure.savefig(path, dpi=150, metadata={"Date": None} if vector else None)
