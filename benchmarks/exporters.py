"""Speed and exactness of the CAD exporters.

    python benchmarks/exporters.py                             # times, against what they may be
    python benchmarks/exporters.py --shapes 200 [--data DIR]   # shapes through both libraries, against area x thickness

Times are CPU times, the least of a few repeats, because other work on the machine can only add to them. The part is a
wheel whose outer loop has lines and arcs by turns, and three bores. --data names a folder of {set}.json files in the
neutral format, every shape of which is added to N generated ones; both libraries must be installed for that.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from d4cad import bench
from d4cad.errors import D4cadError
from d4cad.exporters import occ, write
from d4cad.shapes import DIFFICULTIES, generate
from d4cad.sketch import Circle, Loop, Sketch

COUNTS = (10, 100, 1000)
THICKNESS = 3.0
SCALE = 30.0
"""mm per world unit: parts of some 60 mm."""

VOLUME, EXCHANGE = 1e-9, 1e-8
"""Largest relative error of a volume, and of one after a STEP file from one library to the other."""

BOUNDS = {"faces": 0.15, "STEP": 2.0, "STL": 0.3}
"""The most CPU seconds that these may take for 1000 primitives; all run on one core."""


class Check(NamedTuple):
    """One shape: relative errors of its volumes, and what is wrong with it, if anything is."""

    name: str
    volume: float
    exchange: float
    faults: tuple[str, ...]


def wheel(n: int) -> Sketch:
    """A rim of n edges, lines and arcs by turns, with three bores, 105 mm in radius."""
    angles = 2 * np.pi * np.arange(n) / n
    radii = 100 + 2.5 * (np.arange(n) % 3)
    rim = Loop.from_arrays(np.stack([radii * np.cos(angles), radii * np.sin(angles)], 1), 0.1 * (np.arange(n) % 2))
    return Sketch.from_loops([rim, *(Circle((x, 0.0), 10.0).loop() for x in (-40, 0, 40))], "mm")


def least(work: Callable[[], object], repeats: int) -> float:
    """The least of the CPU seconds that ``work`` takes."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def times(folder: Path) -> bool:
    """Print the table of times; whether all bounds hold."""
    works: dict[str, Callable[[Sketch], object]] = {
        "faces": occ.faces,
        "solid": lambda sketch: occ.solids(sketch, THICKNESS),
        "STEP": lambda sketch: write(sketch, folder / "part.step", thickness=THICKNESS),
        "BREP": lambda sketch: write(sketch, folder / "part.brep", thickness=THICKNESS),
        "STL": lambda sketch: write(sketch, folder / "part.stl", thickness=THICKNESS),
        "SVG": lambda sketch: write(sketch, folder / "part.svg"),
    }
    for library, function in (("build123d", "to_build123d"), ("cadquery", "to_cadquery")):
        try:
            works[function] = getattr(import_module(f"d4cad.exporters.{library}"), function)
        except D4cadError as error:
            print(error)
    sketches = [wheel(n) for n in COUNTS]
    print(f"{'primitives':14}" + "".join(f"{n:>10}" for n in COUNTS) + "   CPU ms; the bound is for 1000")
    fine = True
    for name, work in works.items():
        work(sketches[0])  # imports
        row = [least(lambda w=work, s=s: w(s), 3) for s in sketches]  # type: ignore[misc]
        bound = BOUNDS.get(name)
        fine &= bound is None or row[-1] <= bound
        note = "" if bound is None else f"   at most {1e3 * bound:.0f}{'' if row[-1] <= bound else ': MISSED'}"
        print(f"{name:14}" + "".join(f"{1e3 * t:10.1f}" for t in row) + note)
    return fine


def shapes(count: int, data: Path | None) -> Iterator[tuple[str, Sketch]]:
    """Names and sketches in mm: ``count`` generated shapes of all difficulties, then those of a folder."""
    sizes = tuple(DIFFICULTIES.values())
    for seed in range(count):
        yield f"generated {seed}", generate(np.random.default_rng(seed), sizes[seed % len(sizes)]).scaled(SCALE)
    for case in bench.shapes(data, None) if data is not None else []:
        yield case.name, bench.true_outline(case).scaled(SCALE)


def checked(name: str, sketch: Sketch, folder: Path) -> Check:
    """Put one shape through both libraries, and each one's STEP file through the other."""
    bd, cq = import_module("build123d"), import_module("cadquery")
    true = sketch.area * THICKNESS
    part = bd.extrude(import_module("d4cad.exporters.build123d").to_build123d(sketch), THICKNESS)
    made = cq.Workplane().placeSketch(import_module("d4cad.exporters.cadquery").to_cadquery(sketch)).extrude(THICKNESS)
    first, second = folder / "build123d.step", folder / "cadquery.step"
    bd.export_step(part, first)
    cq.exporters.export(made, str(second))
    there = cq.importers.importStep(str(first))
    back = bd.import_step(second)
    volumes = (part.volume, made.val().Volume())
    exchanged = (sum(solid.Volume() for solid in there.solids().vals()), back.volume)
    kinds = {str(edge.geom_type).split(".")[-1] for edge in part.edges()} | {e.geomType() for e in made.edges().vals()}
    volume = max(abs(v / true - 1) for v in volumes)
    exchange = max(abs(v / true - 1) for v in exchanged)
    wrong = {
        "invalid in build123d": not part.is_valid,
        "invalid in CadQuery": not made.val().isValid(),
        "invalid after STEP": not (back.is_valid and all(solid.isValid() for solid in there.vals())),
        "wrong number of solids": {len(part.solids()), made.solids().size()} != {len(sketch.faces)},
        f"edges of kind {sorted(kinds)}": not kinds <= {"LINE", "CIRCLE"},
        f"volume off by {volume:.1e}": volume > VOLUME,
        f"volume after STEP off by {exchange:.1e}": exchange > EXCHANGE,
    }
    return Check(name, volume, exchange, tuple(fault for fault, found in wrong.items() if found))


def exactness(count: int, data: Path | None, folder: Path) -> bool:
    """Print how many shapes are exact, and what is wrong with the others; whether none are."""
    start = time.perf_counter()
    checks = [checked(name, sketch, folder) for name, sketch in shapes(count, data)]
    faulty = [check for check in checks if check.faults]
    for check in faulty:
        print(f"{check.name}: {', '.join(check.faults)}")
    print(
        f"{len(checks)} shapes, {len(faulty)} faulty, {time.perf_counter() - start:.0f} s; largest relative error of a "
        f"volume {max(c.volume for c in checks):.1e}, after STEP {max(c.exchange for c in checks):.1e}"
    )
    return not faulty


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shapes", type=int, metavar="N", help="check N generated shapes instead of measuring times")
    parser.add_argument("--data", type=Path, metavar="DIR", help="folder of {set}.json files to check as well")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        count: Any = given.shapes
        if count is None and given.data is None:
            sys.exit(not times(folder))
        sys.exit(not exactness(count or 0, given.data, folder))


if __name__ == "__main__":
    main()
