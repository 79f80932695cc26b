"""Programs that exist already: in program files, and drawings as programs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import ceil, log2
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from d4cad import importers, io
from d4cad.canvas import SPAN, Canvas
from d4cad.descent import Record, Stop
from d4cad.errors import D4cadError, InputError
from d4cad.fit import Fit, decibels, joined_outline
from d4cad.grammars.arc_line import ArcLine
from d4cad.grammars.arc_line.structure import Structure
from d4cad.grammars.tree import Tree
from d4cad.importers import Drawing
from d4cad.placement import Placement, stated
from d4cad.plugins import is_script
from d4cad.program import Floats, Program
from d4cad.registry import entry, make_grammar
from d4cad.sketch import Sketch

FILL = 0.9
"""Largest share of a canvas that a drawing's longer side takes."""

SIDE = 1024
"""Pixels along the canvas of a drawing."""


def load_program(path: str | PathLike[str], grammar: str | None = None) -> Fit:
    """The fit that a program file holds, its target excepted, or the program of a .dxf or .svg drawing.

    grammar: the script's grammar, as MODULE:OBJECT or FILE.py:OBJECT, that the file may be in: opening a file runs no
    code that the file alone names. Raises InputError or GeometryError, which name the file.
    """
    path = Path(path)
    if path.suffix.lower() in importers.EXTENSIONS:
        return from_drawing(importers.read(path), path.name)
    file = io.read(path)
    try:
        return _decoded(file, grammar)
    except D4cadError as error:
        raise InputError(f"{path} is not a usable program file: {error}") from None


def from_drawing(drawing: Drawing, name: str) -> Fit:
    """A drawing as an Arc-Line program that places itself where it was drawn.

    name: what reports call it. The drawing is its own target, so that nothing is left to fit. The canvas is as large
    as a power of two times the world, by which coordinates scale without rounding.
    """
    sketch = drawing.sketch
    if sketch.unit != "mm":
        raise InputError(f"expected a drawing in mm, got {sketch.unit}")
    xmin, ymin, xmax, ymax = sketch.bounds
    x, y = (xmin + xmax) / 2, (ymin + ymax) / 2
    scale = 2.0 ** ceil(log2(max(xmax - xmin, ymax - ymin) / (FILL * SPAN)))
    canvas = Canvas.square(SIDE)
    world = sketch.translated(-x, -y).scaled(1 / scale, "world")
    grammar = ArcLine(canvas.pixel)
    return Fit(
        program=grammar.drawn(world.loops),
        canvas=canvas,
        grammar=grammar,
        psnr=decibels(0.0),
        outline=world,
        history=(),
        stop=Stop.STALLED,
        seconds=0.0,
        wall=0.0,
        settings={"drawing": name, "notes": list(drawing.notes)},
        made=Placement(scale=scale * canvas.pixel, origin="drawing", zero=(-x / scale, -y / scale)),
    )


def moved_onto(start: Fit, target: Floats, canvas: Canvas) -> Program[Structure]:
    """A drawing's program scaled and moved so that its bounding box is that of the shape in a picture.

    target: (height, width) coverage on ``canvas``, row 0 lowest. Raises InputError for a target without a shape.
    """
    rows, columns = np.flatnonzero((target > 0.5).any(axis=1)), np.flatnonzero((target > 0.5).any(axis=0))
    if rows.size == 0:
        raise InputError("the picture shows no shape to put the drawing onto")
    low, high = canvas.to_world(np.array([[columns[0], rows[0]], [columns[-1] + 1.0, rows[-1] + 1.0]]))
    box = np.array(start.outline.bounds).reshape(2, 2)
    factor = float(np.sqrt(np.prod((high - low) / (box[1] - box[0]))))
    shift = (low + high) / 2 - factor * (box[0] + box[1]) / 2
    outline = start.outline.scaled(factor, "world").translated(float(shift[0]), float(shift[1]))
    return ArcLine(canvas.pixel).drawn(outline.loops)


def _decoded(file: io.ProgramFile, allowed: str | None) -> Fit:
    if is_script(file.grammar) and file.grammar != allowed:
        raise InputError(f"its grammar {file.grammar} is code that runs only where it is named: --grammar")
    found = entry(file.grammar)
    grammar = make_grammar(file.grammar, "fast", file.canvas)
    structure = grammar.decode(file.structure)
    if len(file.params) != found.size(structure):
        raise InputError(f"its structure has {found.size(structure)} parameters, but its params are {len(file.params)}")
    if file.stop.upper() not in Stop.__members__:
        raise InputError(f"its stop is {file.stop!r}, expected one of {', '.join(Stop.__members__).lower()}")
    program = Program(structure, np.array(file.params))
    if file.relations or file.dimensions:  # a regularised program draws its outline edge by edge
        outline = _related(grammar.outline(program), file)
    elif "drawing" in file.settings:  # it was drawn so: nothing is off that joining could mend
        outline = grammar.outline(program)
    elif "branches" in file.settings and isinstance(grammar, Tree):
        outline = grammar.outline(program, _width(file.settings["branches"]))
    else:
        outline = joined_outline(grammar, program, file.canvas, 10 ** (-file.psnr / 10))
    return Fit(
        program=program,
        canvas=file.canvas,
        grammar=grammar,
        psnr=file.psnr,
        outline=outline,
        history=tuple(Record(**record) for record in file.history),  # type: ignore[arg-type]
        stop=Stop[file.stop.upper()],
        seconds=_seconds(file.extra, "cpu_s"),
        wall=_seconds(file.extra, "wall_s"),
        settings={
            **{key: value for key, value in file.settings.items() if key not in ("placement", "grammar")},
            **({} if grammar.name == file.grammar else {"grammar": file.grammar}),
        },
        made=stated(file.settings.get("placement", {})),
    )


def _related(outline: Sketch, file: io.ProgramFile) -> Sketch:
    """The outline, in world units, with the file's relations, whose lengths are in the file's unit."""
    written = Sketch.from_neutral(file.loops, file.unit)
    if [len(loop.bulges) for loop in written.loops] != [len(loop.bulges) for loop in outline.loops]:
        raise InputError("its loops are not those of its program, so that its relations say nothing")
    factor = outline.length / written.length
    return replace(
        outline,
        relations=tuple(relation.scaled(factor) for relation in file.relations),
        dimensions=tuple(dimension.scaled(factor) for dimension in file.dimensions),
    )


def _width(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < SPAN:
        raise InputError(f"its branches have a width of {value!r}, expected a number of world units")
    return float(value)


def _seconds(extra: Mapping[str, Any], key: str) -> float:
    value = extra.get(key, 0.0)
    return float(value) if isinstance(value, (int, float)) else 0.0
