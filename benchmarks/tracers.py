"""Tracers side by side on shapes whose truth is known: potrace, a contour with greedy arcs, and d4cad.

    python benchmarks/tracers.py [--counts 20 20 10] [--size 256] [--out DIR]

Shapes of about 8, 40 and 95 primitives by `d4cad.shapes.generate` are rendered as area coverage in 8 bits: the mean of
8x8 finer pixels, each with a ramp. potrace (its binary, if there is one) gets the picture enlarged twice by cubic
interpolation and thresholded at 1/2, as its own `mkbitmap` does, since it takes black and white only; its Bezier curves
count as arcs. The baseline walks the sub-pixel contour and takes the longest line or arc within 0.3 px, over and over.
A primitive is recovered if one of the same type has both ends within 1 px; a full circle, which has no ends, if a loop
of arcs keeps within 1 px of it. PSNR is that of the outline drawn anew against the picture. Times are CPU seconds, the
subprocess included. --out gets the three worst pictures of each, and the table as JSON.
"""

from __future__ import annotations

import argparse
import json
import re
import resource
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import fmean, median
from typing import NamedTuple

import contourpy
import numpy as np
from PIL import Image

from d4cad.bench import coverage
from d4cad.canvas import Canvas
from d4cad.edgemodel import AREA_RAMP
from d4cad.fit import decibels
from d4cad.fitting import fit_image, warm
from d4cad.grammars.arc_line import ArcLine, Structure
from d4cad.program import Program
from d4cad.shapes import generate
from d4cad.sketch import Sketch

CLASSES = {"p08": 8, "p40": 40, "p95": 95}
FINER = 8
ENLARGED = 2
GREEDY = 0.3
"""Pixels by which the baseline's edges may leave the contour."""
NEAR = 1.0


class Edge(NamedTuple):
    """A line or an arc (or a curve that stands for one). trace: (n, 2) points along it in pixels, ends included."""

    kind: str
    trace: np.ndarray


Traced = list[list[Edge]]
"""Closed loops in pixels from the lower left corner."""


class Result(NamedTuple):
    tracer: str
    shape: str
    psnr: float
    ratio: float
    recovered: float
    seconds: float
    loops: Traced


def render(sketch: Sketch, size: int) -> np.ndarray:
    fine = coverage(sketch, Canvas.square(size * FINER, AREA_RAMP))
    cover = fine.reshape(size, FINER, size, FINER).mean(axis=(1, 3))
    return np.round(255 * (1 - cover[::-1])).astype(np.uint8)


def edges_of(sketch: Sketch, size: int) -> Traced:
    canvas = Canvas.square(size)
    return [
        [
            Edge("arc" if bulge else "line", canvas.to_pixels(trace))
            for bulge, trace in zip(loop.bulges, loop.traces(canvas.pixel / 50), strict=True)
        ]
        for loop in sketch.loops
    ]


def by_d4cad(picture: np.ndarray) -> Traced:
    return edges_of(fit_image(picture).outline, len(picture))


def by_greedy_arcs(picture: np.ndarray) -> Traced:
    padded = np.pad(1 - picture[::-1] / 255.0, 1)
    loops = []
    for chain in contourpy.contour_generator(z=padded).lines(0.5):
        points = chain[:-1] - 0.5
        if len(points) < 8:
            continue
        z = np.concatenate([points, points[:1]])
        at, loop = 0, []
        while at < len(z) - 1:
            length, edge = longest(z, at)
            loop.append(edge)
            at += length
        loops.append(loop)
    return loops


def longest(z: np.ndarray, at: int) -> tuple[int, Edge]:
    """The longest run of points from `at` within the tolerance of a line or an arc through its ends."""
    best = (1, Edge("line", z[at : at + 2]))
    step, end = 2, at + 2
    while end < len(z):
        found = next((e for e in (line(z[at : end + 1]), arc(z[at : end + 1])) if e is not None), None)
        if found is not None:
            best = (end - at, found)
            step = min(2 * step, 64)
        elif step == 1:
            break
        else:
            step = 1
            end = at + best[0]
        end = min(end + step, len(z) - 1) if end < len(z) - 1 else len(z)
    return best


def line(points: np.ndarray) -> Edge | None:
    along = points[-1] - points[0]
    size = np.hypot(*along)
    if size < 1e-9:
        return None
    off = np.abs((points - points[0]) @ np.array([-along[1], along[0]]) / size)
    return Edge("line", points[[0, -1]]) if off.max() <= GREEDY else None


def arc(points: np.ndarray) -> Edge | None:
    a, b, c = (complex(*points[k]) for k in (0, len(points) // 2, -1))
    w = (c - a) / (b - a) if a != b else 0
    if abs(np.imag(w)) < 1e-9:
        return None
    centre = (b - a) * (w - abs(w) ** 2) / (2j * np.imag(w)) + a
    z = points[:, 0] + 1j * points[:, 1]
    if np.abs(np.abs(z - centre) - abs(a - centre)).max() > GREEDY:
        return None
    middle, end = (np.angle((p - centre) / (a - centre)) % (2 * np.pi) for p in (b, c))
    turn = end if middle <= end else end - 2 * np.pi
    if abs(turn) * abs(a - centre) > 1.2 * np.abs(np.diff(z)).sum() + NEAR:  # around the far side
        return None
    round_ = centre + (a - centre) * np.exp(1j * np.linspace(0, turn, 33))
    return Edge("arc", np.stack([round_.real, round_.imag], axis=1))


def by_potrace(picture: np.ndarray) -> Traced:
    size = len(picture)
    with tempfile.TemporaryDirectory() as folder:
        bitmap, drawing = Path(folder) / "p.pbm", Path(folder) / "p.svg"
        large = Image.fromarray(picture).resize((ENLARGED * size, ENLARGED * size), Image.Resampling.BICUBIC)
        large.point(lambda v: 255 * (v > 127)).convert("1").save(bitmap)
        subprocess.run(["potrace", "-s", "--flat", "-o", str(drawing), str(bitmap)], check=True, capture_output=True)
        text = drawing.read_text()
    # potrace draws in tenths of its pixels, y up, and says so in one transform.
    (data,) = re.findall(r'<path d="([^"]*)"', text)
    return [potrace_loop(part, 10 * ENLARGED) for part in re.findall(r"[Mm][^Mm]*", absolute(data))]


def absolute(data: str) -> str:
    """Path data with absolute coordinates: potrace writes relative ones."""
    out, here, first = [], np.zeros(2), np.zeros(2)
    for letter, numbers in re.findall(r"([MmLlCcHhVvZz])([^MmLlCcHhVvZz]*)", data):
        if letter in "Zz":
            out.append("Z")
            here = first
            continue
        pairs = np.array([float(v) for v in re.findall(r"-?[0-9.]+", numbers)]).reshape(-1, 2)
        group = 3 if letter in "Cc" else 1
        for k in range(0, len(pairs), group):
            points = pairs[k : k + group] + (here if letter.islower() else 0)
            here = points[-1]
            name = "M" if letter in "Mm" and k == 0 else "C" if group == 3 else "L"
            first = here if name == "M" else first
            out.append(name + " ".join(f"{x} {y}" for x, y in points))
    return "".join(out)


def potrace_loop(data: str, scale: float) -> list[Edge]:
    edges, here, first = [], np.zeros(2), np.zeros(2)
    t = np.linspace(0, 1, 25)[:, None]
    for letter, numbers in re.findall(r"([MLCZ])([^MLCZ]*)", data):
        p = np.array([float(v) for v in numbers.split()]).reshape(-1, 2) / scale
        if letter == "M":
            here = first = p[0]
        elif letter == "C":
            curve = (1 - t) ** 3 * here + 3 * (1 - t) ** 2 * t * p[0] + 3 * (1 - t) * t**2 * p[1] + t**3 * p[2]
            edges.append(Edge("arc", curve))
            here = p[2]
        elif np.hypot(*((end := p[0] if letter == "L" else first) - here)) > 1e-6:
            edges.append(Edge("line", np.array([here, end])))
            here = end
    return edges


def redrawn(loops: Traced, picture: np.ndarray) -> float:
    """PSNR in dB of the loops' raster: the traces as polygons."""
    size = len(picture)
    canvas = Canvas.square(size, AREA_RAMP)
    rings = [np.concatenate([edge.trace[:-1] for edge in loop]) for loop in loops if loop]
    if not rings:
        return 0.0
    structure = Structure(tuple(map(len, rings)), (False,) * sum(map(len, rings)))
    drawn = ArcLine(canvas.pixel).rasterize(Program(structure, canvas.to_world(np.concatenate(rings)).ravel()), canvas)
    return decibels(float(np.mean((drawn.coverage - (1 - picture[::-1] / 255.0)) ** 2)))


def recovered(truth: Sketch, loops: Traced, size: int) -> float:
    """The share of the true primitives that a traced one matches."""
    canvas = Canvas.square(size)
    found = [edge for loop in loops for edge in loop]
    hits = 0
    for loop, edges in zip(truth.loops, edges_of(truth, size), strict=True):
        circle = loop.circle
        if circle is not None:
            centre, radius = canvas.to_pixels(np.array(circle.center)), circle.radius / canvas.pixel
            hits += 2 * any(
                all(edge.kind == "arc" and off_circle(edge, centre, radius) <= NEAR for edge in other)
                for other in loops
                if other
            )
            continue
        hits += sum(any(same(edge, other) for other in found) for edge in edges)
    return hits / truth.primitives


def off_circle(edge: Edge, centre: np.ndarray, radius: float) -> float:
    return float(np.abs(np.hypot(*(edge.trace - centre).T) - radius).max())


def same(a: Edge, b: Edge) -> bool:
    if a.kind != b.kind:
        return False
    ends, others = a.trace[[0, -1]], b.trace[[0, -1]]
    return any(np.hypot(*(ends - o).T).max() <= NEAR for o in (others, others[::-1]))


TRACERS: dict[str, Callable[[np.ndarray], Traced]] = {
    "potrace": by_potrace,
    "contour + greedy arcs": by_greedy_arcs,
    "d4cad": by_d4cad,
}


def cpu() -> float:
    return time.process_time() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime


def draw(result: Result, picture: np.ndarray, path: Path) -> None:
    from matplotlib.figure import Figure

    size = len(picture)
    figure = Figure(figsize=(7, 7.3), facecolor="white")
    ax = figure.add_axes((0.01, 0.01, 0.98, 0.94))
    ax.imshow(255 - (255 - picture) * 0.3, cmap="gray", vmin=0, vmax=255, extent=(0, size, 0, size))
    for loop in result.loops:
        for edge in loop:
            ax.plot(*edge.trace.T, color="#1d5fa8" if edge.kind == "line" else "#d1495b", linewidth=1.2)
            ax.plot(*edge.trace[0], "o", color="#1c2733", markersize=2.4)
    ax.set(xticks=[], yticks=[], xlim=(0, size), ylim=(0, size))
    title = (
        f"{result.tracer}, {result.shape}: {result.recovered:.0%} recovered, {result.ratio:.2f} x, {result.psnr:.1f} dB"
    )
    ax.set_title(title, fontsize=10)
    figure.savefig(path, dpi=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--counts", type=int, nargs=3, default=[20, 20, 10], help="shapes of each class")
    parser.add_argument("--size", type=int, default=256, help="pixels a side")
    parser.add_argument("--out", type=Path, help="folder for the worst pictures and the table")
    args = parser.parse_args()
    tracers = dict(TRACERS)
    if shutil.which("potrace") is None:
        print("potrace is missing: its rows are left out (apt-get install potrace)")
        del tracers["potrace"]
    warm("arc-line", "fast")
    results: list[Result] = []
    drawn: dict[str, np.ndarray] = {}
    for (name, primitives), count in zip(CLASSES.items(), args.counts, strict=True):
        for k in range(count):
            truth, shape = generate(np.random.default_rng(k), primitives), f"{name}_{k:03d}"
            drawn[shape] = picture = render(truth, args.size)
            for tracer, trace in tracers.items():
                start = cpu()
                loops = trace(picture)
                seconds = cpu() - start
                ratio = sum(map(len, loops)) / truth.primitives
                share = recovered(truth, loops, args.size)
                results.append(Result(tracer, shape, redrawn(loops, picture), ratio, share, seconds, loops))
    head = ("tracer", "class", "shapes", "recovered", "prim./true", "PSNR median", "worst", "s median")
    print(("{:22s}{:6s}" + "{:>12s}" * 6).format(*head))
    table = []
    for tracer in tracers:
        for name in (*CLASSES, ""):
            rows = [r for r in results if r.tracer == tracer and r.shape.startswith(name)]
            if not rows:
                continue
            psnr = [r.psnr for r in rows]
            cells = (
                fmean(r.recovered for r in rows), fmean(r.ratio for r in rows), median(psnr), min(psnr),
                median(r.seconds for r in rows),
            )  # fmt: skip
            named = dict(zip(("recovered", "ratio", "psnr", "worst", "seconds"), cells, strict=True))
            table.append({"tracer": tracer, "class": name or "all", "shapes": len(rows), **named})
            shown = (f"{cells[0]:.1%}", f"{cells[1]:.2f}", f"{cells[2]:.1f}", f"{cells[3]:.1f}", f"{cells[4]:.3f}")
            print(("{:22s}{:6s}{:12d}" + "{:>12s}" * 5).format(tracer, name or "all", len(rows), *shown))
    if args.out is not None:
        args.out.mkdir(parents=True, exist_ok=True)
        (args.out / "tracers.json").write_text(json.dumps(table, indent=1) + "\n")
        for tracer in tracers:
            order = sorted((r for r in results if r.tracer == tracer), key=lambda r: (r.recovered, r.psnr))
            for k, result in enumerate(order[:3], 1):
                stem = tracer.split()[0]
                draw(result, drawn[result.shape], args.out / f"{stem}-worst-{k}.png")


if __name__ == "__main__":
    main()
