"""Drawings of several layers, each of its own colour, in one SVG or DXF file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import escape

from d4cad.errors import ExportError, InputError
from d4cad.exporters.color import hexadecimal, rgb
from d4cad.exporters.dxf import layered_dxf
from d4cad.exporters.occ import require_mm
from d4cad.exporters.svg import face_path
from d4cad.files import replacing
from d4cad.sketch import Sketch

FORMATS = (".svg", ".dxf")

Layers = Sequence[tuple[str, Sketch]]
"""A colour, #rrggbb, and a sketch in mm, the lowest layer first."""


def write_layered(layers: Layers, path: str | Path) -> None:
    """Writes layers as one drawing: groups of an SVG in their fill, or layers of a DXF in their true colour.

    Raises InputError for no layers or a sketch not in mm, ExportError for another extension or an unwritable file.
    """
    if not layers:
        raise InputError("expected at least one layer")
    for _, sketch in layers:
        require_mm(sketch)
    suffix = Path(path).suffix.lower()
    if suffix == ".svg":
        text = layered_svg(layers)
    elif suffix == ".dxf":
        text = layered_dxf([(f"LAYER_{k}", rgb(color), sketch) for k, (color, sketch) in enumerate(layers, 1)])
    else:
        raise ExportError(f"cannot write {path}: layers in one file are {' or '.join(FORMATS)}, got {suffix or 'none'}")
    with replacing(path) as temporary:
        temporary.write_bytes(text.encode("utf-8"))


def layered_svg(layers: Layers) -> str:
    """One group for each layer, y down, sized in mm."""
    bounds = [sketch.bounds for _, sketch in layers]
    left, bottom = min(b[0] for b in bounds), min(b[1] for b in bounds)
    width, height = max(b[2] for b in bounds) - left, max(b[3] for b in bounds) - bottom
    groups = "\n".join(
        f'<g id="layer-{k}" fill="{escape(hexadecimal(color))}" fill-rule="evenodd">\n'
        + "\n".join(f'  <path d="{face_path(face)}"/>' for face in sketch.faces)
        + "\n</g>"
        for k, (color, sketch) in enumerate(layers, 1)
    )
    box = " ".join(repr(float(part) + 0.0) for part in (left, -(bottom + height), width, height))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width!r}mm" height="{height!r}mm" viewBox="{box}">\n'
        f"{groups}\n</svg>\n"
    )
