"""A picture of the part with the places of findings marked."""

from __future__ import annotations

from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from d4cad.exporters.checks.report import Finding, Report, Status
from d4cad.exporters.preview import require_format
from d4cad.files import replacing

INK, MATERIAL, FRAME = "#1c2733", "#dfe6ee", "#b8c2cc"
COLORS = ("#d1495b", "#1d5fa8", "#c77700", "#5b8c2a", "#7a4fa3", "#008a8a", "#9c5221", "#c2378f", "#6b7a00", "#4a5a6a")
WIDTH, LINE, COLUMNS = 9.0, 0.24, 110
"""Inches wide and per line of text, and characters in a line; the height follows the part and the text."""


def write_picture(path: str | Path, report: Report) -> None:
    """Writes the outline with the places of failed checks as circles and spans, and all findings as a legend.

    PNG or SVG by the extension. Raises ExportError for another extension or an unwritable file.
    """
    from matplotlib.figure import Figure  # not pyplot: no global state, no display

    require_format(path)
    figure = Figure(figsize=(WIDTH, 1.0), facecolor="white")
    texts = [wrap(f"{finding.name}: {finding.message}", COLUMNS) for finding in report.findings]
    ax, height = figure.add_axes((0, 0, 1, 1)), LINE * sum(map(len, texts)) + 2 * LINE
    ax.set_aspect("equal")
    ax.axis("off")
    low, high = _draw_part(ax, report)
    span = np.maximum(high - low, 1e-9)
    margin = 0.06 * float(span.max())
    ax.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
    part = min(WIDTH * float((span[1] + 2 * margin) / (span[0] + 2 * margin)), 8.0)
    total = part + height
    figure.set_size_inches(WIDTH, total)
    ax.set_position((0, height / total, 1, part / total))
    y = height - LINE
    for k, (finding, text) in enumerate(zip(report.findings, texts, strict=True)):
        color = COLORS[k % len(COLORS)] if finding.status is Status.FAILED else INK
        if finding.status is Status.FAILED:
            _mark(ax, finding, color, 0.02 * float(span.max()))
        figure.text(0.02, y / total, finding.status.value, fontsize=9, color=color, va="center")
        for line in text:
            figure.text(0.12, y / total, line, fontsize=9, color=color, va="center")
            y -= LINE
    _save(figure, Path(path))


def _draw_part(ax: Any, report: Report) -> tuple[Any, Any]:
    """The material, filled; returns the corners of its box."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Curve

    boxes = np.array([loop.bounds for loop in report.loops])
    low, high = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    loops = [loop.polygon(2e-4 * float((high - low).max())) for loop in report.loops]
    points = np.concatenate([np.vstack([loop, loop[:1]]) for loop in loops])
    codes = np.concatenate([[Curve.MOVETO, *[Curve.LINETO] * (len(loop) - 1), Curve.CLOSEPOLY] for loop in loops])
    ax.add_patch(PathPatch(Curve(points, codes), facecolor=MATERIAL, edgecolor=INK, linewidth=1.0))
    return low, high


def _mark(ax: Any, finding: Finding, color: str, radius: float) -> None:
    """A ring around each place, and the distance measured where there is one."""
    from matplotlib.patches import Circle

    for k, place in enumerate(finding.places):
        ax.add_patch(Circle((place.x, place.y), radius, fill=False, edgecolor=color, linewidth=1.6, zorder=4))
        if place.to is not None:
            x, y = place.to
            ax.plot([2 * place.x - x, x], [2 * place.y - y, y], color=color, linewidth=1.8, zorder=5)
        if place.value is not None and k < 4:
            ax.annotate(f"{place.value:.2f}", (place.x + radius, place.y + radius), color=color, fontsize=9, zorder=6)


def _save(figure: Any, path: Path) -> None:
    import matplotlib

    vector = path.suffix.lower() == ".svg"
    with matplotlib.rc_context({"svg.hashsalt": "d4cad", "svg.fonttype": "path"}), replacing(path) as temporary:
        figure.savefig(temporary, dpi=110, metadata={"Date": None} if vector else None)
