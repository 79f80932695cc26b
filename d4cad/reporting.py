"""The figures of a fit for its summary and its report."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from pathlib import Path

from d4cad.errors import ExportError
from d4cad.exporters.report import Page, Step, write_report
from d4cad.fidelity import SMALL, Fidelity, Trace, measured
from d4cad.finishing import pixel_mm
from d4cad.fit import Fit
from d4cad.placement import Placement
from d4cad.reduction import length
from d4cad.summary import census, kinds

Relations = Sequence[tuple[str, str]]


def fidelity(fit: Fit, placement: Placement | None = None) -> tuple[Fidelity, Trace]:
    """The figures of a fit and its distances along the outline; features are warned of under its tolerance, else a
    pixel. Raises InputError or ExportError for a fit without a picture or an edge."""
    if fit.target is None:
        raise ExportError("a report needs the picture, and a program file has none")
    mm = pixel_mm(fit, fit.placement() if placement is None else placement)
    asked = fit.settings.get("tolerance")
    tolerance = SMALL if asked is None else length(asked, mm) / mm
    return measured(fit.target, fit.coverage, fit.outline, fit.canvas, mm, fit.psnr, tolerance)


def write_page(fit: Fit, path: str | Path, placement: Placement | None = None, relations: Relations = ()) -> None:
    """Write the report on a fit as one page of HTML.

    relations: names and words of what was snapped. Raises ExportError if the file cannot be written.
    """
    place = fit.placement() if placement is None else placement
    figures, trace = fidelity(fit, place)
    part = place.place(fit.outline, fit.canvas)
    xmin, ymin, xmax, ymax = part.bounds
    counts = {"primitives": fit.primitives, **census(part)}
    assert fit.target is not None
    facts = [
        ("primitives", f"{fit.primitives}: {kinds(counts)}"),
        ("PSNR", f"{fit.psnr:.1f} dB"),
        ("overlap (IoU)", f"{figures.iou:.5f}"),
        ("largest deviation", f"{figures.largest_px:.3f} px ({figures.largest_mm:.3g} mm)"),
        ("mean deviation", f"{figures.mean_px:.3f} px ({figures.mean_mm:.3g} mm)"),
        ("largest, drawn alike", f"{figures.redrawn_px:.3f} px"),
        ("size", f"{xmax - xmin:.4g} x {ymax - ymin:.4g} mm"),
        ("picture", f"{fit.canvas.width} x {fit.canvas.height} px"),
        ("time", f"{fit.wall:.2f} s, {fit.seconds:.2f} s CPU"),
    ]
    steps = [Step(r.step, r.psnr, r.primitives) for r in fit.history if r.loss < inf]
    name = str(fit.settings.get("picture") or "picture")
    page = Page(
        title=f"{name}: a part of {fit.primitives} lines and arcs",
        outline=fit.outline,
        part=part,
        canvas=fit.canvas,
        target=fit.target,
        points=trace.points,
        apart=trace.apart,
        facts=facts,
        history=steps,
        warnings=figures.warnings,
        notes=(*fit.notes(place, solid=False), f"the search ended: {fit.stop.value}"),
        relations=relations,
    )
    write_report(path, page)
