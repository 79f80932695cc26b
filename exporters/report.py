"""A report on one fit: a single page of HTML with all pictures inside, no scripts, nothing to load."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from io import BytesIO, StringIO
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from d4cad.canvas import Canvas
from d4cad.edges import Complexes, Floats
from d4cad.exporters.names import printable
from d4cad.exporters.preview import ARC, INK, LINE
from d4cad.exporters.svg import face_path, loop_path
from d4cad.files import replacing
from d4cad.loop import Loop
from d4cad.sketch import Sketch

MOST_ROWS = 400
"""A table of primitives is cut off there, for a page must stay readable."""
COLORS = ("#2a7f4f", "#b5b11e", "#e8871e", "#c22f2f")
"""Of the deviation map, from none to the largest."""
SPACING = 0.5
"""Pixels, at most, from one point of the deviation map to the next."""
SEEN = 0.006
"""Share of the picture's side that the eye still finds."""
SIDE = 1024
"""Pixels along the longer side of the target that the page shows at most."""


class Step(NamedTuple):
    """One round of the search: gradient steps so far, PSNR in dB, primitives."""

    step: int
    psnr: float
    primitives: int


@dataclass(frozen=True, slots=True)
class Page:
    """What a report shows.

    outline: in world units of ``canvas``. part: the same in mm. target, coverage: (height, width), row 0 lowest.
    points, apart: places along the outline in world units, (n,) complex, and their distances in pixels from the
    picture's edge. facts: label and value, in order. warnings, notes: sentences. relations: names and words of what
    was snapped, if anything was.
    """

    title: str
    outline: Sketch
    part: Sketch
    canvas: Canvas
    target: Floats
    points: Complexes
    apart: Floats
    facts: Sequence[tuple[str, str]]
    history: Sequence[Step] = ()
    warnings: Sequence[str] = ()
    notes: Sequence[str] = ()
    relations: Sequence[tuple[str, str]] = field(default_factory=tuple)


def write_report(path: str | Path, page: Page) -> None:
    """Writes :func:`html` to a file. Raises ExportError if the file cannot be written."""
    text = html(page)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def html(page: Page) -> str:
    """The page as text; the same fit gives the same bytes, but for its times."""
    box = _box(page.canvas)
    worst = float(page.apart.max(initial=0.0))
    rows = "".join(f"<div><dt>{escape(label)}</dt><dd>{escape(value)}</dd></div>" for label, value in page.facts)
    messages = "".join(f'<p class="warning">{escape(text)}</p>' for text in page.warnings)
    messages += "".join(f'<p class="note">{escape(text)}</p>' for text in page.notes)
    figures = [
        ("Target", "the shape is dark", _image(page.target, box, 0.0)),
        (
            "Outline over target",
            f'<b style="color:{LINE}">lines</b>, <b style="color:{ARC}">arcs</b>, a ring at every vertex',
            _image(page.target, box, 0.72) + _overlay(page),
        ),
        ("Distance from the picture's edge", _legend(worst), _image(page.target, box, 0.85) + _map(page, worst)),
    ]
    drawn = "".join(_svg(picture, box, title, caption) for title, caption, picture in figures)
    return Template(PAGE).substitute(
        title=escape(printable(page.title)),
        facts=rows,
        messages=messages,
        figures=drawn,
        history=_history(page.history),
        primitives=_primitives(page.part),
        relations=_relations(page.relations),
    )


def _box(canvas: Canvas) -> tuple[float, float, float, float]:
    """The canvas as an SVG view box in world units, y down."""
    x, y = canvas.extent
    return -x, -y, 2 * x, 2 * y


def _svg(picture: str, box: tuple[float, float, float, float], title: str, caption: str) -> str:
    view = " ".join(f"{part:.6g}" for part in box)
    return (
        f"<figure><h2>{escape(title)}</h2>"
        f'<svg viewBox="{view}" role="img" aria-label="{escape(title)}">{picture}</svg>'
        f"<figcaption>{caption}</figcaption></figure>\n"
    )


def _image(target: Floats, box: tuple[float, float, float, float], fade: float) -> str:
    """The target as a picture in the page, dark shape on white, faded towards white."""
    from PIL import Image

    shade = np.round(255 * (1 - (1 - fade) * target[::-1])).astype(np.uint8)
    image = Image.fromarray(shade)
    image.thumbnail((SIDE, SIDE))
    stream = BytesIO()
    image.save(stream, "PNG", optimize=True)
    data = base64.b64encode(stream.getvalue()).decode("ascii")
    x, y, width, height = box
    return (
        f'<image x="{x:.6g}" y="{y:.6g}" width="{width:.6g}" height="{height:.6g}" preserveAspectRatio="none" '
        f'href="data:image/png;base64,{data}"/>'
    )


def _overlay(page: Page) -> str:
    """The exact outline, lines and arcs in their colours, and its vertices."""
    width = 0.0035 * max(page.canvas.extent) * 2
    parts = {LINE: "", ARC: ""}
    for loop in page.outline.loops:
        for i, bulge in enumerate(loop.bulges):
            parts[ARC if bulge else LINE] += _edge_path(loop, i)
    paths = "".join(
        f'<path d="{d}" fill="none" stroke="{color}" stroke-width="{width:.5g}" stroke-linecap="round"/>'
        for color, d in parts.items()
        if d
    )
    points = [p for loop in page.outline.loops for p in loop.points]
    radius = width * (1.3 if len(points) < 200 else 0.8)
    dots = "".join(f'<circle cx="{x:.6g}" cy="{-y:.6g}" r="{radius:.5g}"/>' for x, y in points)
    return f'{paths}<g fill="#fff" stroke="{INK}" stroke-width="{width / 2:.5g}">{dots}</g>'


def _edge_path(loop: Loop, i: int) -> str:
    """Path data of one edge of a loop, open."""
    n = len(loop.points)
    start, end, bulge = loop.points[i], loop.points[(i + 1) % n], loop.bulges[i]
    if abs(bulge) < 1e-8:
        return f"M{start[0]:.6g} {-start[1]:.6g}L{end[0]:.6g} {-end[1]:.6g}"
    # A loop of the edge and its chord, as the exporter of drawings has it, without what closes it.
    return loop_path(Loop((start, end), (bulge, 0.0))).removesuffix("Z")


def _map(page: Page, worst: float) -> str:
    """The outline in pieces, coloured by their distance."""
    where = page.points
    width = 0.006 * max(page.canvas.extent) * 2
    level = np.minimum(np.floor(len(COLORS) * page.apart / max(worst, 1e-12)), len(COLORS) - 1).astype(int)
    drawn = f'<path d="{" ".join(face_path(face) for face in page.outline.faces)}" fill="none" '
    drawn += f'stroke="{COLORS[0]}" stroke-width="{width:.5g}" stroke-linejoin="round"/>'
    reach = 1.5 * SPACING * page.canvas.pixel
    wide = max(1, round(SEEN * max(page.canvas.shape) / SPACING))
    for k in range(1, len(COLORS)):
        # A corner's half pixel would not be seen: every place is drawn some way along.
        runs = _runs(where, np.convolve(level == k, np.ones(2 * wide + 1), mode="same") > 0, reach)
        if runs:
            size = width * (1 + 0.15 * k)
            drawn += f'<path d="{runs}" fill="none" stroke="{COLORS[k]}" stroke-width="{size:.5g}"/>'
    return drawn


def _runs(where: Complexes, chosen: NDArray[np.bool_], reach: float) -> str:
    """Path data from each chosen point to the next one, where that is within ``reach``."""
    parts: list[str] = []
    last = -1
    for i in np.flatnonzero(chosen[:-1] & (np.abs(np.diff(where)) <= reach)).tolist():
        if i != last:
            parts.append(f"M{where[i].real:.5g} {-where[i].imag:.5g}")
        parts.append(f"L{where[i + 1].real:.5g} {-where[i + 1].imag:.5g}")
        last = i + 1
    return "".join(parts)


def _legend(worst: float) -> str:
    ends = [worst * (k + 1) / len(COLORS) for k in range(len(COLORS))]
    return " ".join(
        f'<span class="key"><i style="background:{color}"></i>to {end:.2g} px</span>'
        for color, end in zip(COLORS, ends, strict=True)
    )


def _history(history: Sequence[Step]) -> str:
    """PSNR and primitives by step, as a drawing."""
    if len(history) < 2:
        return "<p>The search had fewer than two rounds.</p>"
    import matplotlib
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 2.9), facecolor="white")
    left = figure.add_axes((0.15, 0.17, 0.74, 0.77))
    steps = [record.step for record in history]
    left.plot(steps, [record.psnr for record in history], color=LINE, linewidth=1.8)
    left.set_xlabel("gradient steps")
    left.set_ylabel("PSNR, dB", color=LINE)
    left.ticklabel_format(axis="y", useOffset=False)
    right = left.twinx()
    right.step(steps, [record.primitives for record in history], where="post", color=ARC, linewidth=1.8)
    right.set_ylabel("primitives", color=ARC)
    right.set_ylim(bottom=0)
    for ax in (left, right):
        ax.spines[["top"]].set_visible(False)
    stream = StringIO()
    with matplotlib.rc_context({"svg.hashsalt": "d4cad", "svg.fonttype": "none"}):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    text = stream.getvalue()
    drawing = text[text.index("<svg") :]
    # The size in points would keep it from shrinking on a phone.
    head, rest = drawing.split(">", 1)
    view = head[head.index("viewBox") :].split('"')[1]
    return f'<svg class="plot" viewBox="{view}" role="img" aria-label="PSNR and primitives by step">{rest}'


def _primitives(part: Sketch) -> str:
    """A table of lines and arcs in mm, loop by loop."""
    rows: list[str] = []
    number = 0
    for face in part.faces:
        for k, loop in enumerate(face.loops):
            kind = "outline" if k == 0 else "hole"
            for cells in _loop_rows(loop):
                number += 1
                if number <= MOST_ROWS:
                    rows.append(_row([str(number), kind, *cells]))
    more = f"<p>{number - MOST_ROWS} more are in the program file.</p>" if number > MOST_ROWS else ""
    head = ("", "loop", "type", "start", "end", "radius", "length")
    return _table(head, rows) + more


def _loop_rows(loop: Loop) -> list[list[str]]:
    circle = loop.circle
    if circle is not None:
        where = f"centre {_point(circle.center)}"
        return [["circle", where, "", f"{circle.radius:.4f}", f"{2 * np.pi * circle.radius:.4f}"]]
    found = []
    n = len(loop.points)
    for i, bulge in enumerate(loop.bulges):
        start, end = loop.points[i], loop.points[(i + 1) % n]
        chord = float(np.hypot(end[0] - start[0], end[1] - start[1]))
        if bulge == 0:
            found.append(["line", _point(start), _point(end), "", f"{chord:.4f}"])
        else:
            radius = chord * (1 + bulge**2) / (4 * abs(bulge))
            sweep = 4 * np.arctan(abs(bulge))
            found.append(["arc", _point(start), _point(end), f"{radius:.4f}", f"{radius * sweep:.4f}"])
    return found


def _point(p: Any) -> str:
    return f"{p[0] + 0.0:.4f}, {p[1] + 0.0:.4f}"


def _relations(relations: Sequence[tuple[str, str]]) -> str:
    if not relations:
        return ""
    rows = [_row([name, text]) for name, text in relations]
    return f"<section><h2>Relations</h2>{_table(('relation', 'between'), rows)}</section>"


def _row(cells: Sequence[str]) -> str:
    return "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"


def _table(head: Sequence[str], rows: Sequence[str]) -> str:
    titles = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "\n".join(rows)
    return f'<div class="wide"><table><thead><tr>{titles}</tr></thead><tbody>{body}</tbody></table></div>'


PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 76rem; background: #fff; color: #1c2733;
  font: 16px/1.45 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; }
h1 { font-size: 1.4rem; margin: 0 0 .8rem; overflow-wrap: anywhere; }
h2 { font-size: 1rem; margin: 0 0 .4rem; }
dl { display: grid; grid-template-columns: repeat(auto-fill, minmax(10.5rem, 1fr)); gap: .5rem; margin: 0 0 1rem; }
dl div { background: #f1f4f7; border-radius: .4rem; padding: .4rem .6rem; }
dt { font-size: .78rem; color: #566472; }
dd { margin: 0; font-size: .95rem; font-weight: 600; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
.warning, .note { margin: .4rem 0; padding: .45rem .7rem; border-left: .25rem solid #8a99a8; background: #f7f9fa;
  overflow-wrap: anywhere; }
.warning { border-color: #d4761b; background: #fdf3e7; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(21rem, 100%), 1fr)); gap: 1rem;
  margin: 1rem 0; }
figure { margin: 0; }
figure svg { width: 100%; height: auto; max-height: 85vh; border: 1px solid #b8c2cc; display: block; }
figcaption { font-size: .82rem; color: #566472; margin-top: .3rem; }
.key { white-space: nowrap; margin-right: .6rem; }
.key i { display: inline-block; width: .8em; height: .8em; border-radius: 50%; margin-right: .25em; }
section { margin: 1.4rem 0; }
.plot { width: 100%; max-width: 44rem; height: auto; display: block; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .2rem .7rem .2rem 0; border-bottom: 1px solid #e1e6ea; white-space: nowrap; }
th { color: #566472; font-weight: 600; }
</style>
</head>
<body>
<h1>$title</h1>
<dl>$facts</dl>
$messages
<div class="figures">
$figures</div>
<section><h2>Search</h2>
$history
</section>
<section><h2>Primitives, in mm</h2>
$primitives
</section>
$relations
</body>
</html>
"""
