"""Editable source code: the part as an experienced user of a CAD library would write it, parameters on top."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from d4cad.errors import InputError
from d4cad.exporters.mesh import CHORD_TOLERANCE, require_tolerance
from d4cad.exporters.source import build123d, cadquery, openscad
from d4cad.exporters.source.plan import Plan, plan
from d4cad.files import replacing
from d4cad.sketch import Sketch

__all__ = ["DEFAULT", "DIALECTS", "PYTHON", "require_dialect", "source", "write_python", "write_scad", "write_source"]

Python = Callable[[Plan, str], str]

PYTHON: dict[str, Python] = {
    "build123d": build123d.builder,
    "build123d-algebra": build123d.algebra,
    "cadquery": cadquery.source,
}
"""The dialects of a .py file."""

DEFAULT = "build123d"
DIALECTS = (*PYTHON, "openscad")
"""The dialects of :func:`source`."""


def source(
    sketch: Sketch,
    *,
    dialect: str = DEFAULT,
    thickness: float,
    name: str = "",
    scale: float = 1.0,
    tolerance: float = CHORD_TOLERANCE,
) -> str:
    """A script that makes the sketch (mm), extruded from z = 0, and that reads as if written by hand.

    ``dialect``: one of DIALECTS. ``thickness`` (mm) and ``scale`` (mm that one unit in the plane becomes) are the
    values of the parameters of these names; so is ``tolerance``, mm, of OpenSCAD's facets. ``name``: where the
    part comes from, for the first line. Loops that are circles, rectangles, slots or regular polygons within
    1e-6 mm are written as such, with named sizes; equal ones share theirs. The relations and dimensions of the sketch
    become parameters from which its points are computed (`d4cad.exporters.source.shared`). Executed, a Python
    dialect gives ``result``, whose volume is the sketch's to about 1e-9. The same input gives the same text.
    Raises InputError for an unknown dialect, a bad thickness or tolerance, and a sketch that is empty or not in mm,
    GeometryError for a bad scale.
    """
    require_dialect(dialect)
    require_tolerance(tolerance)
    made = plan(sketch, thickness, scale)
    return PYTHON[dialect](made, name) if dialect in PYTHON else openscad.source(made, name, tolerance)


def write_source(
    sketch: Sketch,
    path: str | Path,
    *,
    dialect: str = DEFAULT,
    thickness: float,
    name: str = "",
    scale: float = 1.0,
    tolerance: float = CHORD_TOLERANCE,
) -> None:
    """Writes :func:`source` to a file. Raises as it does, and ExportError if the file cannot be written."""
    text = source(sketch, dialect=dialect, thickness=thickness, name=name, scale=scale, tolerance=tolerance)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def write_python(sketch: Sketch, path: str | Path, *, thickness: float, name: str = "", dialect: str = DEFAULT) -> None:
    """Writes a script in one of the PYTHON dialects; see :func:`write_source`."""
    require_dialect(dialect, python=True)
    write_source(sketch, path, dialect=dialect, thickness=thickness, name=name)


def write_scad(
    sketch: Sketch, path: str | Path, *, thickness: float, name: str = "", tolerance: float = CHORD_TOLERANCE
) -> None:
    """Writes an OpenSCAD file; see :func:`write_source`."""
    write_source(sketch, path, dialect="openscad", thickness=thickness, name=name, tolerance=tolerance)


def require_dialect(dialect: str, *, python: bool = False) -> None:
    """Raises InputError unless there is such a dialect, and one for a .py file if ``python``."""
    if dialect not in DIALECTS:
        raise InputError(f"unknown dialect {dialect!r}: known are {', '.join(DIALECTS)}")
    if python and dialect not in PYTHON:
        raise InputError(f"a .py file cannot be in the dialect {dialect}, only in {', '.join(PYTHON)}")
