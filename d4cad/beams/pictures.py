"""Pictures of a structural problem, of the part designed for it with its stress, and of the search."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from d4cad.beams.problem import Load, Place, Problem, Support
from d4cad.beams.stress import Analysis
from d4cad.descent import Record
from d4cad.exporters.preview import require_format
from d4cad.files import replacing
from d4cad.sketch import Sketch

INK, FRAME, GROUND, SOLID, HELD, FORCE = "#1c2733", "#b8c2cc", "#e8edf2", "#5b6b7b", "#1d5fa8", "#d1495b"

WIDTH, TALLEST = 8.0, 6.0
"""Inches: the width of a picture and the greatest height of a panel."""

Panel = tuple[float, Callable[[Any, Any], None]]
"""Height of a panel as a share of its width, and what draws it on axes of a figure."""


def problem_panel(problem: Problem) -> Panel:
    """Domain, fixed regions, supports (blue: held in x, y or both) and loads (red)."""

    def draw(figure: Any, ax: Any) -> None:
        _domain(ax, problem, GROUND)
        for places, style in (
            (problem.solids, {"facecolor": SOLID, "edgecolor": "none"}),
            (problem.voids, {"facecolor": "white", "edgecolor": INK, "hatch": "////", "linewidth": 0.6}),
            (problem.cuts, {"facecolor": "white", "edgecolor": "none"}),
        ):
            for place in places:
                ax.add_patch(_patch(place, **style))
        _actions(ax, problem)
        forces = ", ".join(f"{np.hypot(*load.force):g} N" for load in problem.loads)
        _title(ax, f"{problem.name}: {problem.size[0]:g} x {problem.size[1]:g} mm, {forces}, volume {problem.volume:g}")

    return _aspect(problem), draw


def design_panel(problem: Problem, part: Sketch, fine: Analysis) -> Panel:
    """The outline over the von Mises stress of its elements, colours up to the 99.5th percentile."""

    def draw(figure: Any, ax: Any) -> None:
        _domain(ax, problem, "white")
        field = np.where(fine.solid, fine.von_mises, np.nan)
        top = float(np.nanpercentile(field, 99.5))
        height, width = (n * fine.side for n in fine.solid.shape)
        shown = ax.imshow(
            field,
            origin="lower",
            extent=(0, width, 0, height),
            cmap="viridis",
            vmin=0,
            vmax=top,
            interpolation="nearest",
        )
        for loop in part.loops:
            line = loop.polygon(problem.element / 20)
            ax.plot(*np.concatenate([line, line[:1]]).T, color=INK, linewidth=1.2)
        points = np.array([point for loop in part.loops for point in loop.points])
        ax.scatter(points[:, 0], points[:, 1], s=10, facecolor="white", edgecolor=INK, linewidth=0.7, zorder=3)
        _actions(ax, problem)
        bar = figure.colorbar(shown, ax=ax, fraction=0.03, pad=0.015)
        bar.ax.tick_params(labelsize=8)
        bar.set_label("von Mises stress, MPa", fontsize=8)
        _title(ax, f"{part.primitives} primitives, compliance {fine.compliance:.4g}, von Mises stress")

    return _aspect(problem), draw


def history_panel(history: Sequence[Record], loss: str = "compliance over the full domain's") -> Panel:
    """Loss, named so, and primitives of the program, round by round."""

    def draw(figure: Any, ax: Any) -> None:
        rounds = np.arange(1, len(history) + 1)
        ax.plot(rounds, [record.loss for record in history], color=INK, marker="o", markersize=3)
        ax.set_xlabel("round", fontsize=8)
        ax.xaxis.get_major_locator().set_params(integer=True)
        ax.set_ylabel(loss, fontsize=8)
        other = ax.twinx()
        other.step(rounds, [record.primitives for record in history], where="post", color=FORCE)
        other.set_ylabel("primitives of the program", fontsize=8, color=FORCE)
        other.yaxis.get_major_locator().set_params(integer=True)
        for axes in (ax, other):
            axes.tick_params(labelsize=8)
            axes.spines[:].set_color(FRAME)
        _title(ax, "search")

    return 0.35, draw


def write_picture(path: str | Path, panels: Sequence[Panel], dpi: int = 100) -> None:
    """Panels one above the other, as .png or .svg. Raises ExportError for another extension or an unwritable file."""
    require_format(path)
    import matplotlib
    from matplotlib.figure import Figure  # not pyplot: no global state, no display

    heights = [min(0.85 * WIDTH * share, TALLEST) for share, _ in panels]
    figure = Figure(figsize=(WIDTH, sum(heights) + 0.4 * len(panels)), facecolor="white", layout="constrained")
    axes = figure.subplots(len(panels), 1, height_ratios=heights, squeeze=False)
    for ax, (_, draw) in zip(axes[:, 0], panels, strict=True):
        draw(figure, ax)
    with replacing(path) as part, matplotlib.rc_context({"svg.hashsalt": "d4cad", "svg.fonttype": "path"}):
        vector = part.suffix.lower() == ".svg"
        figure.savefig(part, dpi=dpi, metadata={"Date": None} if vector else None)


def _aspect(problem: Problem) -> float:
    reach = _reach(problem)
    return (problem.size[1] + 2 * reach) / (problem.size[0] + 2 * reach)


def _reach(problem: Problem) -> float:
    """Length in mm of an arrow, and the room that is left around the domain."""
    return 0.13 * min(problem.size)


def _domain(ax: Any, problem: Problem, color: str) -> None:
    from matplotlib.patches import Rectangle

    width, height = problem.size
    room = 1.2 * _reach(problem)
    ax.add_patch(Rectangle((0, 0), width, height, facecolor=color, edgecolor=FRAME, linewidth=0.8, zorder=0))
    ax.set(xlim=(-room, width + room), ylim=(-room, height + room), aspect="equal", xticks=[], yticks=[])
    ax.spines[:].set_visible(False)


def _actions(ax: Any, problem: Problem) -> None:
    for support in problem.supports:
        _support(ax, support)
    greatest = max(float(np.hypot(*load.force)) for load in problem.loads)
    for load in problem.loads:
        _load(ax, load, _reach(problem), greatest)


def _support(ax: Any, support: Support) -> None:
    place, marker = support.place, {"x": ">", "y": "^", "xy": "s"}[support.fix]
    if place.box or place.radius:
        ax.add_patch(_patch(place, facecolor="none", edgecolor=HELD, hatch="....", linewidth=1.5, zorder=4))
        return
    (x0, y0), (x1, y1) = place.start, place.end
    ax.plot([x0, x1], [y0, y1], color=HELD, linewidth=4, solid_capstyle="butt", zorder=4)
    ax.scatter([(x0 + x1) / 2], [(y0 + y1) / 2], s=40, marker=marker, color=HELD, zorder=4)


def _load(ax: Any, load: Load, reach: float, greatest: float) -> None:
    """An arrow along the force from the middle of its place; longer for a larger force."""
    size = float(np.hypot(*load.force))
    if size == 0:
        return
    x, y = ((a + b) / 2 for a, b in zip(load.place.start, load.place.end, strict=True))
    dx, dy = (f / size * reach * (0.4 + 0.6 * size / greatest) for f in load.force)
    if load.place.start != load.place.end and not load.place.box:
        ax.plot(*zip(load.place.start, load.place.end, strict=True), color=FORCE, linewidth=4, zorder=4)
    style = {"arrowstyle": "-|>", "color": FORCE, "linewidth": 2, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 14}
    ax.annotate("", xy=(x + dx, y + dy), xytext=(x, y), arrowprops=style, annotation_clip=False, zorder=5)


def _patch(place: Place, **style: Any) -> Any:
    from matplotlib.patches import Circle, Polygon, Rectangle

    (x0, y0), (x1, y1), r = place.start, place.end, place.radius
    if place.box:
        return Rectangle(place.start, x1 - x0, y1 - y0, **style)
    if place.start == place.end:
        return Circle(place.start, r, **style)
    length = float(np.hypot(x1 - x0, y1 - y0))
    nx, ny = (y1 - y0) / length * r, (x0 - x1) / length * r
    return Polygon([(x0 + nx, y0 + ny), (x1 + nx, y1 + ny), (x1 - nx, y1 - ny), (x0 - nx, y0 - ny)], **style)


def _title(ax: Any, text: str) -> None:
    ax.set_title(text, fontsize=10, color=INK, loc="left")
