"""Parts that commands read from program files and drawings, in millimetres as the file places them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from d4cad.errors import D4cadError, GeometryError, InputError

if TYPE_CHECKING:
    from d4cad.loop import Loop
    from d4cad.sketch import Sketch


def read_loops(path: Path) -> list[Loop]:
    """The loops of a program file or drawing in mm, as they are: they may cross. Raises InputError.

    Loops in world units get the size that the file's placement states and keep their origin; without one they are
    refused, because nothing can be said in mm about them.
    """
    from d4cad import importers, io
    from d4cad.programs import load_program
    from d4cad.sketch import loop_from_neutral

    if path.suffix.lower() in importers.EXTENSIONS:
        return list(importers.read(path).sketch.loops)
    file = io.read(path)
    try:
        loops = [loop_from_neutral(loop, f"loop {k}") for k, loop in enumerate(file.loops)]
    except GeometryError as error:
        raise InputError(f"{path} is not a usable program file: {error}") from None
    if not loops:
        raise InputError(f"{path} is not a usable program file: it has no loops")
    if file.unit == "mm":
        return loops
    fit = load_program(path)
    xmin, _, xmax, _ = fit.outline.bounds
    place = fit.placement()
    if not place.sized:
        raise InputError(f"{path} states no size in mm: write it by `d4cad fit` with --width, --scale or --dpi")
    factor = place.pixel_size / fit.canvas.pixel if place.width is None else place.width / (xmax - xmin)
    return [loop.scaled(factor) for loop in loops]


def read_part(path: Path) -> Sketch:
    """The part of a program file or drawing in mm; see :func:`read_loops`. InputError if they bound no region."""
    from d4cad.sketch import Sketch

    try:
        return Sketch.from_loops(read_loops(path), "mm")
    except GeometryError as error:
        raise InputError(f"{path} bounds no region: {error}") from None


def read_thickness(path: Path) -> float | None:
    """The thickness in mm that the file's placement states, if any."""
    from d4cad import importers, io

    if path.suffix.lower() in importers.EXTENSIONS:
        return None
    place = io.read(path).settings.get("placement", {})
    value = place.get("thickness") if isinstance(place, dict) else None
    return float(value) if isinstance(value, (int, float)) and value > 0 else None


def pair(text: str, between: str, name: str) -> tuple[float, float]:
    """Two finite numbers written as ``X<between>Y``; raises D4cadError that names the option."""
    from math import isfinite

    first, found, second = text.partition(between)
    try:
        x, y = float(first), float(second)
    except ValueError:
        found = ""
    if not found or not (isfinite(x) and isfinite(y)):
        raise D4cadError(f"{name} must be two numbers such as 10{between}20, got {text!r}")
    return x, y
