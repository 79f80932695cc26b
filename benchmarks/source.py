"""Editable source, executed: how far its solid is from the kernel's own of the same sketch, by dialect.

    python benchmarks/source.py [--shapes 200] [--data DIR] [--snap] [--dialects build123d build123d-algebra cadquery]

Shapes are drawn by `d4cad.shapes.generate`, of 8, 40 and 95 primitives in turn, shape k with the seed k, and scaled to
some 100 mm; with --data, every shape of every `{set}.json` in the neutral format is added. With --snap they are drawn
as exact rasters of 256 pixels and fitted first, so that they have relations and named sizes. For each dialect it prints
the worst relative error of the volume against `exporters.occ` and against area x thickness, the largest shift of
the centroid relative to the part's size, how many solids were invalid, and the time that writing and running took.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from d4cad.bench import coverage
from d4cad.canvas import Canvas
from d4cad.exporters import occ
from d4cad.exporters.source import PYTHON, source
from d4cad.fitting import fit_coverage
from d4cad.placement import Placement
from d4cad.shapes import DIFFICULTIES, generate
from d4cad.sketch import Sketch

THICKNESS = 3.0
MM = 45.0
"""Millimetres per world unit."""


@dataclass(slots=True)
class Worst:
    """The worst of all shapes, each with the shape's name."""

    volume: tuple[float, str] = (0.0, "")
    exact: tuple[float, str] = (0.0, "")
    shift: tuple[float, str] = (0.0, "")
    invalid: int = 0
    longest: tuple[float, str] = (0.0, "")
    seconds: float = 0.0


def sketches(shapes: int, data: Path | None) -> Iterator[tuple[str, Sketch]]:
    """Names and sketches in mm."""
    sizes = tuple(DIFFICULTIES.values())
    for k in range(shapes):
        primitives = sizes[k % len(sizes)]
        yield f"p{primitives:02d}_{k}", generate(np.random.default_rng(k), primitives).scaled(MM)
    for file in sorted(data.glob("*.json")) if data is not None else ():
        for entry in json.loads(file.read_text(encoding="utf-8")):
            yield f"{file.stem}_{entry['index']}", Sketch.from_neutral(entry["loops"]).scaled(MM)


def fitted(shape: Sketch) -> Sketch:
    """The shape as it is found in its raster, with relations, in mm."""
    canvas = Canvas.square(256)
    placement = Placement(scale=MM * canvas.pixel, origin="center")
    found = fit_coverage(coverage(shape.scaled(1 / MM, "world"), canvas), canvas, snap=True, size=placement)
    return placement.place(found.outline, canvas)


def executed(text: str) -> Any:
    """The OCP shape of a script's `result`."""
    names: dict[str, Any] = {"__name__": "part"}
    exec(compile(text, "part.py", "exec"), names)
    result = names["result"]
    return result.wrapped if hasattr(result, "wrapped") else result.val().wrapped


def centroid(shape: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    properties = import_module("OCP.GProp").GProp_GProps()
    import_module("OCP.BRepGProp").BRepGProp.VolumeProperties_s(shape, properties)
    point = properties.CentreOfMass()
    return np.array([point.X(), point.Y(), point.Z()])


def compare(name: str, sketch: Sketch, dialect: str, worst: Worst) -> None:
    truth = occ.compound(occ.solids(sketch, THICKNESS))
    began = time.perf_counter()
    shape = executed(source(sketch, dialect=dialect, thickness=THICKNESS, name=name))
    seconds = time.perf_counter() - began
    volume, expected, exact = occ.volume(shape), occ.volume(truth), sketch.area * THICKNESS
    xmin, ymin, xmax, ymax = sketch.bounds
    shift = float(np.abs(centroid(shape) - centroid(truth)).max()) / max(xmax - xmin, ymax - ymin)
    worst.volume = max(worst.volume, (abs(volume / expected - 1), name))
    worst.exact = max(worst.exact, (abs(volume / exact - 1), name))
    worst.shift = max(worst.shift, (shift, name))
    worst.invalid += not occ.is_valid(shape)
    worst.longest = max(worst.longest, (seconds, name))
    worst.seconds += seconds


def main() -> None:
    parser = argparse.ArgumentParser(description="editable source against the kernel's own solids")
    parser.add_argument("--shapes", type=int, default=200)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--snap", action="store_true")
    parser.add_argument("--dialects", nargs="+", default=tuple(PYTHON), choices=tuple(PYTHON))
    chosen = parser.parse_args()
    found = [(name, fitted(shape) if chosen.snap else shape) for name, shape in sketches(chosen.shapes, chosen.data)]
    print(f"{len(found)} shapes; worst relative error of the volume against OCP, against area x thickness; shift")
    for dialect in chosen.dialects:
        worst = Worst()
        for name, sketch in found:
            compare(name, sketch, dialect, worst)
        print(
            f"{dialect:18s} {worst.volume[0]:.1e} ({worst.volume[1]})  {worst.exact[0]:.1e} ({worst.exact[1]})  "
            f"{worst.shift[0]:.1e}  invalid {worst.invalid}  "
            f"{worst.seconds / max(len(found), 1):.2f} s each, at most {worst.longest[0]:.1f} s"
        )


if __name__ == "__main__":
    main()
