"""Ways from drawings to a Sketch: a table of readers by extension."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from os import PathLike
from pathlib import Path

from d4cad.errors import GeometryError, InputError
from d4cad.importers.drawing import Drawing
from d4cad.importers.dxf import read_dxf
from d4cad.importers.svg import read_svg

__all__ = ["EXTENSIONS", "GAP", "TOLERANCE", "Drawing", "read"]

TOLERANCE = 0.01
"""mm by which lines and arcs may leave a spline or an ellipse of a drawing."""

GAP = 0.01
"""mm between the ends of strokes that are taken to meet."""

READERS = {".dxf": read_dxf, ".svg": read_svg}

EXTENSIONS = tuple(READERS)
"""The extensions that :func:`read` knows."""


def read(
    path: str | PathLike[str], *, tolerance: float = TOLERANCE, gap: float = GAP, layers: Sequence[str] = ()
) -> Drawing:
    """The closed outlines of a DXF or SVG drawing as a sketch in mm, and what the user should know about them.

    Lines and circular arcs stay exact; splines and ellipses become arcs within ``tolerance`` mm. Loose strokes are
    joined where their ends are at most ``gap`` mm apart. ``layers``: of a DXF drawing, those to read; all visible ones
    if empty. Raises InputError for a file that is not such a drawing, GeometryError for outlines that bound no region.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            f"cannot read {path}: known drawings are {' '.join(READERS)}, got {path.suffix or 'no extension'}"
        )
    for name, value in (("tolerance", tolerance), ("gap", gap)):
        if not (isfinite(value) and value > 0):
            raise InputError(f"the {name} must be a positive number in mm, got {value:g}")
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"there is no drawing {path}") from None
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None
    try:
        return reader(data, tolerance, gap, layers)
    except (InputError, GeometryError) as error:
        raise type(error)(f"{path} is not a usable drawing: {error}") from None
