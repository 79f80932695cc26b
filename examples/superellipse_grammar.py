"""A grammar of one's own: unions of superellipses |u / a|^p + |v / b|^p <= 1, of which only rewrites change p.

`d4cad fit a.png --grammar examples/superellipse_grammar.py:ENTRY -o a.step` uses it (docs/grammar-authoring.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from scipy.ndimage import distance_transform_edt

from d4cad.arrangement import regions
from d4cad.canvas import Canvas
from d4cad.errors import GrammarError
from d4cad.fit import Fit
from d4cad.fitting import fit_coverage
from d4cad.program import Edit, Floats, Program, Rewrite
from d4cad.protocols import RuleFacts
from d4cad.raster.band import Band
from d4cad.raster.fields import union_of_fields
from d4cad.registry import Entry
from d4cad.segmentation import segment
from d4cad.sketch import Sketch

ROUNDEST, SQUAREST = 2, 16
FACTS = {
    "bud": RuleFacts("a half-size copy inside, touching an end of an axis", inverse="remove", exact=True),
    "add": RuleFacts("a new disc where most is missing", inverse="remove"),
    "remove": RuleFacts("a superellipse goes", "more than one superellipse"),
    "squarer": RuleFacts("twice the exponent", f"an exponent under {SQUAREST}", inverse="rounder"),
    "rounder": RuleFacts("half the exponent", f"an exponent over {ROUNDEST}", inverse="squarer"),
}

Exponents: TypeAlias = tuple[int, ...]
"""The structure. A superellipse has 5 parameters: centre x, y, half-sizes a, b, angle of its own x axis."""
Shape: TypeAlias = Program[Exponents]


@dataclass(frozen=True, slots=True)
class Superellipses:
    """Superellipses whose union is the shape. least: half-size, in world units, under which repair drops one."""

    rules: frozenset[str] = frozenset(FACTS)
    least: float = 3 / 256
    name: str = "superellipse"

    def axiom(self, canvas: Canvas) -> Shape:
        """An ellipse over two thirds of the canvas."""
        return Program((ROUNDEST,), np.array([0.0, 0.0, *(2 * side / 3 for side in canvas.extent), 0.0]))

    def rewrites(self, program: Shape, demand: Floats, canvas: Canvas, rng: np.random.Generator) -> list[Rewrite]:
        """All rewrites; a site is the number of a superellipse."""
        found, count = [], len(program.structure)
        for i, p in enumerate(program.structure):
            rules = ["bud"] * 4 + ["remove"] * (count > 1) + ["squarer"] * (p < SQUAREST) + ["rounder"] * (p > ROUNDEST)
            found += [Rewrite(rule, frozenset((i,)), (float(i), k * np.pi / 2)) for k, rule in enumerate(rules)]
        room = distance_transform_edt(np.pad(demand > 0.5, 1))[1:-1, 1:-1]
        row, col = np.unravel_index(np.argmax(room), room.shape)
        if room[row, col] >= 1:
            place = canvas.to_world(np.array([col + 0.5, row + 0.5]))
            found.append(Rewrite("add", frozenset(), (*place.tolist(), float(room[row, col]) * canvas.pixel)))
        return [rewrite for rewrite in found if rewrite.rule in self.rules]

    def apply(self, program: Shape, rewrites: Sequence[Rewrite]) -> Edit[Exponents]:
        """Apply rewrites at disjoint sites; all cannot go."""
        old, new = program.params.reshape(-1, 5), []
        exponents, gone = list(program.structure), set[int]()
        for rewrite in rewrites:
            i = int(rewrite.data[0])
            if rewrite.rule == "add":
                new.append((ROUNDEST, [*rewrite.data, rewrite.data[2], 0.0]))
            elif rewrite.rule == "bud":
                x, y, a, b, angle = old[i]
                u, v, c, s = np.cos(rewrite.data[1]) * a, np.sin(rewrite.data[1]) * b, np.cos(angle), np.sin(angle)
                new.append((exponents[i], [x + (c * u - s * v) / 2, y + (s * u + c * v) / 2, a / 2, b / 2, angle]))
            elif rewrite.rule == "remove":
                gone.add(i)
            else:
                exponents[i] = exponents[i] * 2 if rewrite.rule == "squarer" else exponents[i] // 2
        kept = [i for i in range(len(old)) if i not in gone or len(gone) == len(old)]
        rows = np.array([*old[kept], *(row for _, row in new)])
        origin = np.concatenate([np.add.outer(5 * np.array(kept), np.arange(5)).ravel(), np.full(5 * len(new), -1)])
        structure = (*(exponents[i] for i in kept), *(p for p, _ in new))
        return Edit(Program(structure, rows.ravel()), origin)

    def repair(self, program: Shape) -> Edit[Exponents]:
        """The same superellipses without those that are too small to see."""
        small = np.flatnonzero(program.params.reshape(-1, 5)[:, 2:4].min(axis=1) < self.least).tolist()
        edit = self.apply(program, [Rewrite("remove", frozenset((i,)), (float(i),)) for i in small])
        return edit if edit.origin.size < program.params.size else Edit(program, edit.origin)

    def primitives(self, program: Shape) -> int:
        return len(program.structure)

    complexity = primitives

    def growth(self, program: Shape, rewrite: Rewrite) -> float:
        return {"bud": 1.0, "add": 1.0, "remove": -1.0}.get(rewrite.rule, 0.0)

    def rasterize(self, program: Shape, canvas: Canvas) -> Band:
        """Coverage, with derivatives by finite differences."""
        return union_of_fields(canvas, program.params.reshape(-1, 5), lambda i, *a: distance(program.structure[i], *a))

    def outline(self, program: Shape) -> Sketch:
        """The union as lines and arcs, within a tenth of ``least`` of the curves."""
        loops = []
        around = np.exp(2j * np.pi * np.arange(360) / 360).view(float).reshape(-1, 2)
        for (x, y, a, b, turn), p in zip(program.params.reshape(-1, 5), program.structure, strict=True):
            u, v = (around / np.linalg.norm(around, p, axis=1, keepdims=True) * (abs(a), abs(b))).T
            z = x + 1j * y + np.exp(1j * turn) * (u + 1j * v)
            loops.append(segment(z.view(float).reshape(-1, 2), self.least / 10))
        return Sketch.from_loops(regions(loops), "world")

    def encode(self, structure: Exponents) -> Any:
        return list(structure)

    def decode(self, value: Any) -> Exponents:
        if not (isinstance(value, list) and value and all(type(p) is int and p >= ROUNDEST for p in value)):
            raise GrammarError(f"expected a list of exponents, got {value!r}")
        return tuple(value)


def distance(p: int, numbers: Floats, x: Floats, y: Floats) -> Floats:
    """First-order distance (g - 1) / |grad g| for the norm g of which a superellipse is the unit circle."""
    cx, cy, a, b, turn = numbers
    q = (x + 1j * y - cx - 1j * cy) * np.exp(-1j * turn)
    u, v = np.abs(q.real / a), np.abs(q.imag / b)
    g = np.maximum((u**p + v**p) ** (1 / p), 1e-6)
    slope = np.hypot((u / g) ** (p - 1) / a, (v / g) ** (p - 1) / b)
    return np.asarray((g - 1) / np.maximum(slope, 1e-9))


ENTRY = Entry(lambda c, rules: Superellipses(rules, c.pixel), FACTS, size=lambda s: 5 * len(s), counted="superellipse")


def main() -> Fit:
    """Fits a picture of a rounded plate with a round lug."""
    canvas = Canvas.square(64)
    truth: Shape = Program((8, 2), np.array([-0.2, 0.0, 0.8, 0.5, 0.3, 0.7, 0.3, 0.4, 0.3, 0.3]))
    fit = fit_coverage(Superellipses().rasterize(truth, canvas).coverage, canvas, grammar=f"{__file__}:ENTRY")
    print(f"{fit.primitives} superellipses, {fit.psnr:.1f} dB, exponents {fit.program.structure}")
    return fit


if __name__ == "__main__":
    main()
