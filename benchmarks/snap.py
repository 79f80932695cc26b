"""What regularisation finds and what it makes of the vertices, on generated shapes whose truth is known.

    python benchmarks/snap.py [--count 30] [--primitives 12] [--seed 0] [--cases exact area256 ...] [--worst]

Shape k is drawn by `d4cad.shapes.generate` with the seed k, rendered as each case says, fitted, and snapped. A relation
counts as true if it holds in the truth to 1e-6, as found if it holds exactly in the snapped outline, as false if it was
told and does not hold in the truth. Only edges that match one of the truth (same kind, ends within 2 pixels) count.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from d4cad.bench import coverage
from d4cad.canvas import Canvas
from d4cad.fit import Fit
from d4cad.fitting import fit_coverage, fit_image, warm
from d4cad.regularize import Parameters
from d4cad.regularize.equations import equations
from d4cad.regularize.measures import Measures
from d4cad.relations import Relation
from d4cad.shapes import generate
from d4cad.sketch import Circle, Loop, Sketch

TRUE = 1e-6
"""Largest residual of a relation that holds in the truth: radians, ratios, world units."""
WRONG = 0.0035
"""Residual of a relation that is not only nearly true: 0.2 degrees, 0.35 per cent."""
EXACT = 1e-8
"""The same in a snapped outline."""
MATCH = 2.0
"""Pixels within which the ends of an edge match those of a true one."""
PAIRS = ("parallel", "perpendicular", "equal_radius", "concentric", "equal_length", "collinear")
SINGLE = ("horizontal", "vertical")
OVERSAMPLING = 8
TOP = 140.0
"""dB above which a fit is as exact as rounding lets it be."""


def exact(truth: Sketch, pixels: int, rng: np.random.Generator, snap: bool) -> Fit:
    """The paper's raster, as floats."""
    canvas = Canvas.square(pixels)
    return fit_coverage(coverage(truth, canvas), canvas, snap=snap)


def area(truth: Sketch, pixels: int, rng: np.random.Generator, snap: bool, noise: float = 0.0) -> Fit:
    """Area coverage in 8 bits, with noise of this standard deviation."""
    fine = coverage(truth, Canvas.square(pixels * OVERSAMPLING, 0.5))
    grey = fine.reshape(pixels, OVERSAMPLING, pixels, OVERSAMPLING).mean(axis=(1, 3))
    grey = np.clip(0.1 + 0.8 * grey + noise * rng.standard_normal(grey.shape), 0, 1) if noise else grey
    return fit_image((255 * grey[::-1]).round().astype(np.uint8), snap=snap)


def noisy(truth: Sketch, pixels: int, rng: np.random.Generator, snap: bool) -> Fit:
    """Area coverage in 8 bits with noise."""
    return area(truth, pixels, rng, snap, 0.05)


Render = Callable[[Sketch, int, np.random.Generator, bool], Fit]
CASES: dict[str, tuple[Render, int, float]] = {
    "exact256": (exact, 256, 0.0),
    "area256": (area, 256, 0.0),
    "area64": (area, 64, 0.0),
    "noise128": (noisy, 128, 0.0),
    "noise64": (noisy, 64, 0.0),
    "near-exact256": (exact, 256, 1.0),
    "near-area256": (area, 256, 1.0),
}
"""How to render, at how many pixels, and by how many pixels to move every vertex first, so that nothing is true."""


def part(seed: int, primitives: int, jitter: float) -> Sketch:
    """The generated part, its vertices and radii moved by ``jitter`` units of 3 / 256 in random directions."""
    rng = np.random.default_rng(seed)
    sketch = generate(rng, primitives)
    if not jitter:
        return sketch
    loops = []
    for loop in sketch.loops:
        turn = np.exp(2j * np.pi * rng.random(len(loop.points))) * jitter * 3 / 256
        if loop.circle is not None:
            turn[:] = turn[0]
            (x, y), r = loop.circle.center, loop.circle.radius + jitter * 3 / 256 * rng.choice([-0.5, 0.5])
            loops.append(Circle((x + turn[0].real, y + turn[0].imag), r).loop())
        else:
            points = np.array(loop.points) + np.stack([turn.real, turn.imag], axis=1)
            loops.append(Loop.from_arrays(points, np.array(loop.bulges)))
    return Sketch.from_loops(loops)


@dataclass(eq=False)
class Tally:
    """Counts of one case. before, after: vertex errors in pixels. told, false: relations by kind."""

    shapes: int = 0
    before: list[float] = field(default_factory=list)
    after: list[float] = field(default_factory=list)
    true: Counter[str] = field(default_factory=Counter)
    found: Counter[str] = field(default_factory=Counter)
    told: Counter[str] = field(default_factory=Counter)
    false: Counter[str] = field(default_factory=Counter)
    wrong: int = 0
    psnr: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    worse: list[str] = field(default_factory=list)


def matched(found: Sketch, truth: Sketch, reach: float) -> dict[int, int]:
    """Edges of ``found`` to those of ``truth``: same kind, both ends and the apex within ``reach``."""
    own, other = (_ends(sketch) for sketch in (found, truth))
    if not (own.size and other.size):
        return {}
    off = np.abs(own[:, None, :] - other[None, :, :]).max(axis=2)
    a, b = Parameters(found), Parameters(truth)
    off[a.arcs[:, None] != b.arcs[None, :]] = np.inf
    pairs, used = {}, set()
    for k in np.argsort(off.min(axis=1)).tolist():
        j = int(np.argmin(off[k]))
        if off[k, j] <= reach and j not in used:
            pairs[k] = j
            used.add(j)
    return pairs


def _ends(sketch: Sketch) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
    """(E, 3) complex start, apex and end of every edge, circles from their right."""
    layout = Parameters(sketch)
    loops = layout.sketched(layout.values).loops
    parts = [loop.edges for loop in loops]
    z0, z1, b = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return np.stack([z0, (z0 + z1) / 2 - 0.5j * b * (z1 - z0), z1], axis=1)


def residual(relation: Relation, layout: Parameters, measures: Measures) -> float:
    """The largest residual of a relation."""
    return float(np.abs(equations(relation, layout, measures).residual).max(initial=0.0))


def compare(fit: Fit, plain: Fit, truth: Sketch, tally: Tally, name: str) -> None:
    """Add one shape to a tally."""
    pixel = fit.canvas.pixel
    mine, right = Parameters(fit.outline), Parameters(truth)
    at, true_at = Measures.of(mine, mine.values), Measures.of(right, right.values)
    pairs = matched(fit.outline, truth, MATCH * pixel)
    relations = [Relation(kind, (mine.refs[k],)) for kind in SINGLE for k in pairs if not mine.arcs[k]]
    second = {right.starts[loop] + 1 for loop in np.flatnonzero(right.circles)}
    for a, b in combinations([k for k in pairs if pairs[k] not in second], 2):
        lines, arcs = not (mine.arcs[a] or mine.arcs[b]), mine.arcs[a] and mine.arcs[b]
        for kind in PAIRS:
            if arcs if kind in ("equal_radius", "concentric") else lines:
                relations.append(Relation(kind, (mine.refs[a], mine.refs[b])))
    for a in pairs:
        after = int(mine.following[a])
        if (
            after in pairs
            and (mine.arcs[a] or mine.arcs[after])
            and pairs[a] not in second
            and pairs[after] not in second
        ):
            relations.append(Relation("tangent", (mine.refs[a], mine.refs[after])))
    for relation in relations:
        image = _image(relation, mine, right, pairs)
        if image is not None and residual(image, right, true_at) <= TRUE:
            tally.true[relation.kind] += 1
            tally.found[relation.kind] += residual(relation, mine, at) <= EXACT
    for relation in fit.outline.relations:
        image = _image(relation, mine, right, pairs)
        if image is not None:
            tally.told[relation.kind] += 1
            off = residual(image, right, true_at)
            if off > TRUE:
                tally.false[relation.kind] += 1
                tally.wrong += off > WRONG
                tally.worse.append(f"{name}: {relation.kind} {relation.refs} is off by {off:.2g}")
    before, after = _vertex_errors(plain.outline, fit.outline, truth, pixel)
    tally.before += before
    tally.after += after
    tally.psnr.append(min(fit.psnr, TOP) - min(plain.psnr, TOP))
    tally.shapes += 1
    if before and np.mean(after) > np.mean(before) * 1.1 + 1e-4:
        tally.worse.append(f"{name}: vertices {np.mean(before):.4f} -> {np.mean(after):.4f} px")
    if tally.psnr[-1] < -1:
        tally.worse.append(f"{name}: {plain.psnr:.1f} -> {fit.psnr:.1f} dB")


def _image(relation: Relation, mine: Parameters, right: Parameters, pairs: dict[int, int]) -> Relation | None:
    numbers = [pairs.get(mine.number(ref)) for ref in relation.refs]
    if any(k is None for k in numbers):
        return None
    refs = tuple(right.refs[k] for k in numbers if k is not None)
    return Relation(relation.kind, refs, relation.value)


def _vertex_errors(plain: Sketch, snapped: Sketch, truth: Sketch, pixel: float) -> tuple[list[float], list[float]]:
    """Distance in pixels from the true start of each edge, before and after, that matches in both."""
    own, moved, other = (_ends(sketch)[:, 0] for sketch in (plain, snapped, truth))
    first, second = (matched(sketch, truth, MATCH * pixel) for sketch in (plain, snapped))
    back = {true: k for k, true in second.items()}
    both = [(k, back[true], true) for k, true in first.items() if true in back]
    before = [abs(own[k] - other[true]) / pixel for k, _, true in both]
    return before, [abs(moved[k] - other[true]) / pixel for _, k, true in both]


def case(name: str, count: int, primitives: int, seed: int) -> Tally:
    """All shapes of a case."""
    render, pixels, jitter = CASES[name]
    tally = Tally()
    for k in range(seed, seed + count):
        truth = part(k, primitives, jitter)
        plain = render(truth, pixels, np.random.default_rng(k), False)
        started = time.process_time()
        fit = render(truth, pixels, np.random.default_rng(k), True)
        tally.seconds.append(time.process_time() - started - plain.seconds)
        compare(fit, plain, truth, tally, f"{name} seed {k}")
    return tally


def report(name: str, tally: Tally) -> str:
    """A few lines of text."""
    before, after = np.array(tally.before), np.array(tally.after)
    true, found = sum(tally.true.values()), sum(tally.found.values())
    told, false = sum(tally.told.values()), sum(tally.false.values())
    kinds = ", ".join(f"{kind} {tally.found[kind]}/{tally.true[kind]}" for kind in sorted(tally.true))
    wrong = ", ".join(f"{kind} {tally.false[kind]}/{tally.told[kind]}" for kind in sorted(tally.false))
    return "\n".join(
        [
            f"{name}: {tally.shapes} shapes, vertex error px mean {before.mean():.5f} -> {after.mean():.5f}, "
            f"median {np.median(before):.5f} -> {np.median(after):.5f}, PSNR dB mean {np.mean(tally.psnr):+.2f} "
            f"least {np.min(tally.psnr):+.2f}, snapping s median {np.median(tally.seconds):.3f}",
            f"  true relations found {found}/{true} = {found / max(true, 1):.1%} ({kinds})",
            f"  told {told}, false {false} = {false / max(told, 1):.2%} ({wrong}), by over {WRONG:g}: {tally.wrong}",
        ]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="regularisation of generated shapes")
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--primitives", type=int, default=12)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--worst", action="store_true", help="name what went wrong")
    chosen = parser.parse_args()
    warm("arc-line", "fast")
    for name in chosen.cases:
        tally = case(name, chosen.count, chosen.primitives, chosen.seed)
        print(report(name, tally))
        if chosen.worst:
            print(*(f"  {line}" for line in tally.worse), sep="\n")


if __name__ == "__main__":
    main()
