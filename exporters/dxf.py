"""DXF for laser, plasma and router: closed polylines whose arcs are arcs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from io import StringIO
from pathlib import Path
from typing import Any

from d4cad.exporters.color import Rgb
from d4cad.exporters.kerf import compensated
from d4cad.exporters.occ import require_mm
from d4cad.files import replacing
from d4cad.loop import Loop
from d4cad.sketch import Sketch

VERSION = "R2010"
MILLIMETRES = 4
"""$INSUNITS."""

OUTER, INNER = "OUTER", "INNER"
COLORS = {INNER: 1, OUTER: 7}
"""Layers and their AutoCAD colours: red, and black or white."""


def write_dxf(sketch: Sketch, path: str | Path, *, kerf: float | None = None) -> None:
    """Writes the sketch (mm) as a DXF drawing in mm whose bytes are reproducible.

    Each loop is one closed LWPOLYLINE with bulges, or a CIRCLE, on the layer OUTER or INNER; a part's holes come before
    its outline, as they are to be cut. ``kerf``: mm that the cutter takes away, see
    :func:`d4cad.exporters.kerf.compensated`. Raises InputError for a bad kerf, unit or size, ExportError if the file
    cannot be written.
    """
    require_mm(sketch)
    text = dxf(compensated(sketch, kerf))
    with replacing(path) as temporary:
        temporary.write_bytes(text.encode("utf-8"))


def dxf(sketch: Sketch) -> str:
    """The text of the drawing of a sketch in mm; lines end in "\\n"."""
    ezdxf = import_module("ezdxf")
    with _undated():
        document = ezdxf.new(VERSION, units=MILLIMETRES)
        for layer, color in COLORS.items():
            document.layers.add(layer, color=color)
        space = document.modelspace()
        for face in sketch.faces:
            for hole in face.holes:
                _add(space, hole, INNER)
            _add(space, face.outer, OUTER)
        xmin, ymin, xmax, ymax = sketch.bounds
        space.reset_extents((xmin, ymin, 0), (xmax, ymax, 0))
        document.set_modelspace_vport(1.1 * max(ymax - ymin, xmax - xmin), ((xmin + xmax) / 2, (ymin + ymax) / 2))
        stream = StringIO()
        document.write(stream)
    return stream.getvalue()


def layered_dxf(layers: Sequence[tuple[str, Rgb, Sketch]]) -> str:
    """The text of a drawing of several sketches in mm, each on the layer of its name in its true colour."""
    ezdxf = import_module("ezdxf")
    with _undated():
        document = ezdxf.new(VERSION, units=MILLIMETRES)
        space = document.modelspace()
        for name, color, sketch in layers:
            red, green, blue = color
            document.layers.add(name, true_color=red << 16 | green << 8 | blue)
            for face in sketch.faces:
                for loop in (*face.holes, face.outer):
                    _add(space, loop, name)
        boxes = [sketch.bounds for _, _, sketch in layers]
        low, high = [min(b[k] for b in boxes) for k in (0, 1)], [max(b[k] for b in boxes) for k in (2, 3)]
        space.reset_extents((*low, 0), (*high, 0))
        stream = StringIO()
        document.write(stream)
    return stream.getvalue()


def _add(space: Any, loop: Loop, layer: str) -> None:
    where = {"layer": layer}
    circle = loop.circle
    if circle is not None:
        space.add_circle(circle.center, circle.radius, dxfattribs=where)
        return
    corners = [(x, y, bulge) for (x, y), bulge in zip(loop.points, loop.bulges, strict=True)]
    space.add_lwpolyline(corners, format="xyb", close=True, dxfattribs=where)


@contextmanager
def _undated() -> Iterator[None]:
    """Has ezdxf write fixed dates and identifiers, and puts its setting back for the user's own drawings."""
    options = import_module("ezdxf").options
    before = options.write_fixed_meta_data_for_testing
    try:
        options.write_fixed_meta_data_for_testing = True
        yield
    finally:
        options.write_fixed_meta_data_for_testing = before
