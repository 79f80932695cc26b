"""How exactly DXF and SVG files give a part's area back, and how long the files of 1000 primitives take.

    python benchmarks/formats.py [--shapes 200] [--data DIR] [--seed 0]

Shapes are drawn by `d4cad.shapes.generate`, and read from the files `{set}.json` of DIR in the neutral format. Each is
scaled to some 60 mm and written; DXF is read back by ezdxf, SVG by svgpathtools, and the areas are compared.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Iterator
from io import StringIO
from math import atan, hypot, pi, radians, sin, tau
from pathlib import Path
from xml.etree import ElementTree

import ezdxf
import numpy as np
import svgpathtools

from d4cad import exporters
from d4cad.exporters.dxf import dxf
from d4cad.exporters.svg import svg
from d4cad.shapes import generate
from d4cad.sketch import Circle, Loop, Sketch

SCALE = 20.0
"""mm per world unit."""

Named = tuple[str, Sketch]


def drawn(count: int, seed: int) -> Iterator[Named]:
    """Generated shapes of 8, 40 and 95 primitives in turn, in mm, away from the origin."""
    for k in range(seed, seed + count):
        shape = generate(np.random.default_rng(k), (8, 40, 95)[k % 3])
        yield f"generated {k}", shape.scaled(SCALE).translated(30.0, 50.0)


def stored(folder: Path) -> Iterator[Named]:
    """Every shape of the neutral files of a folder, in mm."""
    for path in sorted(folder.glob("*.json")):
        for entry in json.loads(path.read_text(encoding="utf-8")):
            yield f"{path.stem} {entry['index']}", Sketch.from_neutral(entry["loops"]).scaled(SCALE)


def dxf_area(text: str) -> float:
    """Area between the layers OUTER and INNER, from the radii of circles and the bulges of polylines."""
    area = 0.0
    for entity in ezdxf.read(StringIO(text)).modelspace():
        sign = 1 if entity.dxf.layer == "OUTER" else -1
        if entity.dxftype() == "CIRCLE":
            area += sign * pi * entity.dxf.radius**2
        else:
            area += sign * abs(_bulged_area(list(entity.get_points("xyb"))))
    return area


def _bulged_area(corners: list[tuple[float, float, float]]) -> float:
    x0, y0, _ = corners[0]
    area = 0.0
    for (xa, ya, b), (xb, yb, _) in zip(corners, corners[1:] + corners[:1], strict=True):
        area += ((xa - x0) * (yb - y0) - (xb - x0) * (ya - y0)) / 2
        if b:
            sweep = 4 * atan(b)
            area += (hypot(xb - xa, yb - ya) / (2 * sin(sweep / 2))) ** 2 * (sweep - sin(sweep)) / 2
    return area


def svg_area(text: str) -> float:
    """Area of the paths, holes negative, from the angles of the arcs; y points down."""
    area = 0.0
    for element in ElementTree.fromstring(text).iter("{http://www.w3.org/2000/svg}path"):
        for piece in svgpathtools.parse_path(element.get("d")).continuous_subpaths():
            origin = piece[0].start
            for part in piece:
                area -= ((part.start - origin).conjugate() * (part.end - origin)).imag / 2
                if isinstance(part, svgpathtools.Arc):
                    sweep = radians(part.delta)
                    area -= part.radius.real * part.radius.imag * (sweep - sin(sweep)) / 2
    return area


def thousand() -> Sketch:
    """A toothed disc of 994 lines and arcs with three bores, 100 mm across."""
    count = 994
    angles = np.arange(count) * tau / count
    radii = np.where(np.arange(count) % 4 < 2, 50.0, 48.0)
    points = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    bulges = np.where(np.arange(count) % 2 == 0, 0.0, 0.1)
    bores = [Circle((20 * np.cos(a), 20 * np.sin(a)), 6.0).loop() for a in (0.0, tau / 3, 2 * tau / 3)]
    return Sketch.from_loops([Loop.from_arrays(points, bulges), *bores], "mm")


def times(sketch: Sketch, runs: int = 3) -> dict[str, float]:
    """Seconds of the fastest of some runs for each format; the first one has loaded the libraries."""
    found = {}
    with tempfile.TemporaryDirectory() as scratch:
        for extension in exporters.EXTENSIONS:
            path, taken = Path(scratch) / f"part{extension}", []
            for _ in range(runs):
                start = time.perf_counter()
                exporters.write(sketch, path, thickness=5)
                taken.append(time.perf_counter() - start)
            found[extension] = min(taken)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description="exactness and speed of the file formats")
    parser.add_argument("--shapes", type=int, default=200)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    errors: dict[str, list[tuple[float, str]]] = {"dxf": [], "svg": []}
    for name, sketch in [*drawn(chosen.shapes, chosen.seed), *(stored(chosen.data) if chosen.data else ())]:
        for kind, area in (("dxf", dxf_area(dxf(sketch))), ("svg", svg_area(svg(sketch)))):
            errors[kind].append((abs(area / sketch.area - 1), name))
    for kind, found in errors.items():
        if found:
            worst, name = max(found)
            print(f"{kind}: worst relative error of {len(found)} areas {worst:.1e} ({name})")
    sketch = thousand()
    for extension, seconds in times(sketch).items():
        print(f"{extension}: {seconds * 1000:.0f} ms for {sketch.primitives} primitives")


if __name__ == "__main__":
    main()
