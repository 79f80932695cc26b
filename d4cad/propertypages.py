"""A grammar's report as text, Markdown, JSON and a picture."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from d4cad.errors import ExportError
from d4cad.files import check_writable, replacing
from d4cad.laboratory import SHAKEN, STEPS
from d4cad.properties import BACK, Report

FORMATS = (".json", ".md", ".png", ".svg")
HEAD = (
    "rewrite",
    "tries",
    "same shape",
    "jump, px2",
    "90 %",
    "refitted",
    "back by",
    "at once",
    "fitted",
    "reach",
    "span",
)
INK, ONCE, FITTED, DOT = "#1c2733", "#1d5fa8", "#a9c4e4", "#d1495b"
WRITTEN_ON = 0.3
"""Share from which a dark bar lies behind the name in it."""
LEAST_JUMP = 1e-4
"""px2 below which a picture shows a jump as none."""


def rows(report: Report) -> list[tuple[str, ...]]:
    """The table of rewrites, a row each, as HEAD names the columns."""
    return [
        (
            found.rule,
            str(found.tries),
            _share(found.same),
            _number(found.jump.median),
            _number(found.jump.high),
            _number(found.refitted.median),
            found.inverse or "-",
            _share(found.undone),
            _share(found.mended),
            _share(found.reach.median),
            f"{found.span.median:.2f}",
        )
        for found in report.rules
    ]


def sentences(report: Report) -> list[str]:
    """What the table does not hold."""
    control, repairs = report.control, report.repairs
    found = [
        f"A parameter moves {_share(control.reach.median)} of the boundary (median), {_share(control.reach.high)} "
        f"(90 %), {_share(control.reach.most)} (most); the span of what it moves is {control.span.median:.2f} of the "
        f"whole boundary's; {_share(control.idle)} of the parameters move nothing.",
        f"Of {repairs.tries} programs whose parameters were each moved by about {SHAKEN:g} px "
        f"{_share(repairs.violated)} needed repair and {_share(repairs.repaired)} of those then needed no more; "
        f"{_share(repairs.drawable)} of all bound a region. Repair changed "
        f"the shape by {_number(repairs.change.median)} px2 (median), {_number(repairs.change.high)} (90 %), "
        f"{_number(repairs.change.most)} (most).",
    ]
    if report.unseen:
        found.append(f"Never offered: {', '.join(report.unseen)}.")
    return found + [f"Not as the grammar says: {sentence}." for sentence in report.broken]


def title(report: Report) -> str:
    """What was measured, in one line."""
    low, high = report.primitives
    return (
        f"{report.grammar}: {report.programs} random programs of {low} to {high} primitives, "
        f"{report.pixels} x {report.pixels} px, seed {report.seed}"
    )


def text(report: Report) -> str:
    """The report for a terminal."""
    table = [HEAD, *rows(report)]
    widths = [max(len(row[k]) for row in table) for k in range(len(HEAD))]
    left = (0, HEAD.index("back by"))
    lines = []
    for row in table:
        cells = [row[k].ljust(w) if k in left else row[k].rjust(w) for k, w in enumerate(widths)]
        lines.append("  ".join(cells))
    return "\n".join([title(report), "", *(line.rstrip() for line in lines), "", *sentences(report)])


def markdown(report: Report) -> str:
    """The report as a table and sentences in Markdown."""
    lines = [f"| {' | '.join(HEAD)} |", "|" + "---|" * len(HEAD)]
    lines += [f"| {' | '.join(row)} |" for row in rows(report)]
    return "\n".join([f"{title(report)}.", "", *lines, "", *(f"- {sentence}" for sentence in sentences(report)), ""])


def facts(report: Report) -> dict[str, Any]:
    """The report as JSON values."""
    return asdict(report)


def check(paths: Sequence[Path]) -> None:
    """Raises ExportError, before anything is measured, for a file that could not be written."""
    for path in paths:
        if path.suffix.lower() not in FORMATS:
            got = path.suffix or "no extension"
            raise ExportError(f"cannot write {path}: a grammar's report is {' '.join(FORMATS)}, got {got}")
        check_writable(path)


def write(report: Report, path: Path) -> None:
    """Write the report as the extension says. Raises ExportError."""
    check([path])
    suffix = path.suffix.lower()
    if suffix in (".png", ".svg"):
        _draw(report, path)
        return
    content = json.dumps(facts(report), allow_nan=False) + "\n" if suffix == ".json" else markdown(report)
    with replacing(path) as temporary:
        temporary.write_text(content, encoding="utf-8")


def _draw(report: Report, path: Path) -> None:
    """Four panels, one for each property."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = [found.rule for found in report.rules]
    places = [-float(k) for k in range(len(names))]
    figure = Figure(figsize=(11, 2.6 + 0.24 * len(names)), layout="constrained")
    FigureCanvasAgg(figure)
    back, jump, reach, repair = figure.subplots(1, 4)
    back.barh(places, [100 * f.mended for f in report.rules], 0.7, color=FITTED, label=f"fitted, to {BACK:g} px2")
    back.barh(places, [100 * f.undone for f in report.rules], 0.4, color=ONCE, label="at once, exactly")
    for place, found in zip(places, report.rules, strict=True):
        ink = "white" if found.undone > WRITTEN_ON else INK
        back.text(2, place, found.inverse or "", va="center", fontsize=6.5, color=ink)
    back.set_yticks(places, names)
    back.set_xlim(0, 100)
    back.set_xlabel(f"% led back by one rewrite ({STEPS} steps)")
    back.set_title("reversibility")
    below: dict[str, Any] = {
        "loc": "upper center", "bbox_to_anchor": (0.5, -0.38 / (1.2 + 0.24 * len(names))), "frameon": False,
        "ncols": 2, "fontsize": 6.5,
    }  # fmt: skip
    back.legend(**below)
    for place, found in zip(places, report.rules, strict=True):
        shown = [max(value, LEAST_JUMP) for value in found.jumps]
        jump.plot(shown, _scattered(place, len(shown)), ".", color=DOT, markersize=3, alpha=0.5)
        jump.plot([max(found.jump.median, LEAST_JUMP)], [place], "|", color=INK, markersize=9, markeredgewidth=1.5)
    jump.set_xscale("log")
    jump.set_xlim(LEAST_JUMP / 2, report.pixels**2)
    jump.set_yticks(places, [])
    jump.set_xlabel(f"change of the shape, px2 (left: under {LEAST_JUMP:g})")
    jump.set_title("jump continuity")
    for place, found in zip(places, report.rules, strict=True):
        reach.plot(
            [100 * v for v in found.reaches], _scattered(place, found.tries), ".", color=DOT, markersize=3, alpha=0.5
        )
        reach.plot([100 * found.reach.median], [place], "|", color=INK, markersize=9, markeredgewidth=1.5)
    reach.axvline(100 * report.control.reach.median, color=ONCE, linewidth=1, label="one parameter: median, 90 %")
    reach.axvline(100 * report.control.reach.high, color=ONCE, linewidth=1, linestyle=":")
    reach.set_yticks(places, [])
    reach.set_xlim(-2, 102)
    reach.set_xlabel("% of the boundary within reach")
    reach.set_title("local control")
    reach.legend(**below)
    changes = sorted(report.repairs.changes)
    repair.step(changes, [100 * (k + 1) / len(changes) for k in range(len(changes))], color=ONCE, where="post")
    repair.set_ylim(0, 100)
    repair.set_xlabel("change of the shape by repair, px2")
    repair.set_ylabel("% of repaired programs")
    repair.set_title(f"repairability: {_share(report.repairs.repaired)}")
    for panel in (back, jump, reach, repair):
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(labelsize=7)
        panel.xaxis.label.set_size(7.5)
        panel.yaxis.label.set_size(7.5)
    for panel in (back, jump, reach):
        panel.set_ylim(-len(names) + 0.4, 0.6)
    figure.suptitle(title(report), fontsize=9)
    with replacing(path) as temporary, mpl.rc_context({"svg.hashsalt": "d4cad"}):
        figure.savefig(
            temporary, dpi=90, metadata={"Date": None} if path.suffix.lower() == ".svg" else {"Software": None}
        )


def _scattered(place: float, count: int) -> list[float]:
    """Heights around a row, so that equal values show as several."""
    return [place + 0.3 * (2 * (k + 0.5) / count - 1) for k in range(count)]


def _share(value: float) -> str:
    percent = 100 * value
    return f"{percent:.1f} %" if 0 < percent < 10 else f"{percent:.0f} %"


def _number(value: float) -> str:
    return "0" if value < 1e-9 else f"{value:.2g}" if value < 10 else f"{value:.0f}"
