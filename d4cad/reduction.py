"""What `d4cad simplify` does, as functions: a drawing or program read, made of fewer primitives, and compared."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import Any

from d4cad import importers
from d4cad.deviation import drawn_apart
from d4cad.errors import InputError
from d4cad.fit import Fit
from d4cad.importers import GAP, TOLERANCE, Drawing
from d4cad.placement import DEFAULT_DPI, INCH
from d4cad.programs import from_drawing, load_program
from d4cad.simplification import simplified
from d4cad.sketch import Sketch
from d4cad.summary import census, kinds

READING = 1 / 20
"""Share of the tolerance within which splines are read as arcs; the rest is left for their simplification."""

UNITS = {"": 1.0, "mm": 1.0, "cm": 10.0, "in": INCH}


@dataclass(frozen=True, slots=True)
class Reduction:
    """A drawing before and after. Sketches in mm.

    segments: number of pieces that the file draws it with. tolerance, deviation: mm, the latter the Hausdorff distance
    of the two. seconds: of the simplification alone.
    """

    name: str
    before: Sketch
    after: Sketch
    segments: int
    tolerance: float
    deviation: float
    seconds: float
    notes: tuple[str, ...]

    @property
    def fit(self) -> Fit:
        """The simplified drawing as a program."""
        return from_drawing(Drawing(self.after, self.segments, self.notes), self.name)

    def facts(self, files: Sequence[Path]) -> dict[str, Any]:
        """The report as JSON values; lengths in mm, areas in mm^2."""
        xmin, ymin, xmax, ymax = self.after.bounds
        return {
            "drawing": self.name,
            "segments": self.segments,
            "primitives_before": self.before.primitives,
            "primitives": self.after.primitives,
            **census(self.after),
            "faces": len(self.after.faces),
            "holes": sum(len(face.holes) for face in self.after.faces),
            "tolerance_mm": self.tolerance,
            "deviation_mm": self.deviation,
            "size_mm": [xmax - xmin, ymax - ymin],
            "area_before_mm2": self.before.area,
            "area_mm2": self.after.area,
            "wall_s": self.seconds,
            "notes": list(self.notes),
            "files": [str(path) for path in files],
        }


def reduced(
    path: str | PathLike[str], tolerance: str | float, *, gap: float = GAP, layers: Sequence[str] = ()
) -> Reduction:
    """A .dxf or .svg drawing or a .json program with as few lines and arcs as stay within a tolerance of it.

    tolerance: mm, or text with a unit as :func:`length` reads it. gap, layers: as :func:`d4cad.importers.read` has
    them. Raises InputError or GeometryError for what cannot be used.
    """
    path = Path(path)
    if path.suffix.lower() == ".json":
        if layers:
            raise InputError("layers can be chosen in DXF drawings only")
        fit = load_program(path)
        pixel = fit.placement().pixel_size if fit.made.width is None else INCH / DEFAULT_DPI
        within = length(tolerance, pixel)
        sketch = fit.sketch()
        drawing = Drawing(sketch, sketch.primitives, fit.notes(fit.placement(), solid=False))
        rest = within
    else:
        within = length(tolerance, INCH / DEFAULT_DPI)
        fine = min(TOLERANCE, READING * within)
        drawing = importers.read(path, tolerance=fine, gap=gap, layers=layers)
        rest = within - fine
    start = time.perf_counter()
    after = simplified(drawing.sketch, rest)
    seconds = time.perf_counter() - start
    apart = drawn_apart(drawing.sketch.loops, after.loops)
    return Reduction(path.name, drawing.sketch, after, drawing.segments, within, apart, seconds, drawing.notes)


def length(value: str | float, pixel: float, name: str = "tolerance") -> float:
    """A length in mm from a number of mm or text such as 0.05, 0.05mm, 0.002in or 2px; ``pixel``: mm.

    ``name``: what errors call it. Raises InputError for anything else and for lengths that are not positive.
    """
    found = re.fullmatch(r"\s*([0-9.eE+-]+)\s*(mm|cm|in|px|)\s*", str(value))
    try:
        number = float(found[1]) if found else float("nan")
    except ValueError:
        number = float("nan")
    size = number * (pixel if found and found[2] == "px" else UNITS[found[2]]) if found else number
    if not (isfinite(size) and size > 0):
        raise InputError(f"the {name} must be a positive length such as 0.05mm, 0.002in or 2px, got {value!r}")
    return size


def text(facts: dict[str, Any]) -> str:
    """The report for people, a few lines."""
    before, after = facts["area_before_mm2"], facts["area_mm2"]
    drawn = f"{facts['segments']} segments, " if facts["segments"] != facts["primitives_before"] else ""
    width, height = facts["size_mm"]
    lines = [
        f"{drawn}{facts['primitives_before']} -> {facts['primitives']} primitives ({kinds(facts)})",
        f"{width:.6g} x {height:.6g} mm, at most {facts['deviation_mm']:.2g} mm off, {facts['tolerance_mm']:g} allowed",
        f"area {before:.6g} -> {after:.6g} mm2 ({100 * (after / before - 1):+.2g} %)",
        *(f"note: {note}" for note in facts["notes"]),
        *(f"wrote {path}" for path in facts["files"]),
    ]
    return "\n".join(lines)
