"""The Union-Rect grammar: a union of rectangles at any angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from d4cad.canvas import Canvas
from d4cad.errors import GrammarError
from d4cad.grammars.arc_line.scene import Picture
from d4cad.grammars.union_rect.outline import separate, union
from d4cad.grammars.union_rect.places import DemandPlaces, Places
from d4cad.grammars.union_rect.raster import entries, scan, slopes
from d4cad.grammars.union_rect.repair import repair
from d4cad.grammars.union_rect.rules import Exchange, add, hole, merge, merge_gain, near, remove, split
from d4cad.grammars.union_rect.structure import NUMBERS, Structure, program_of, rects_of, to_pixels, to_world
from d4cad.grammars.union_rect.trials import trial
from d4cad.program import Edit, Floats, Program, Rewrite
from d4cad.protocols import Trial
from d4cad.raster.band import Band

if TYPE_CHECKING:
    from d4cad.sketch import Sketch

GRAIN = 0.1
"""What an outline resolves, in pixels: see :func:`d4cad.grammars.union_rect.outline.union`."""
RULES = ("split-h", "split-v", "add-rect", "add-hole", "merge", "remove")


@dataclass(frozen=True, slots=True)
class UnionRect:
    """Rectangles whose union is the shape.

    pixel: the world length that counts as one pixel in ``least`` and ``lap``. rules: the names of the rewrites in use.
    places: where new rectangles, holes and splits are proposed. merge_reach: pairs are merged if
    their circumscribed circles touch, made so many times as large; merge_limit: and if the box around them adds at most
    so much, and remove_limit: rectangles are removed if they have at most so much, as products of half-sizes in world
    units. least: repair drops rectangles with a lesser half-size (pixels). lap: how far (pixels)
    pieces of one rectangle, and rectangles that repair shortens, reach beneath each other. nearby: how many neighbours
    a trial refits when it removes a rectangle.
    """

    pixel: float = 3 / 256
    rules: frozenset[str] = frozenset(RULES)
    places: Places = field(default_factory=DemandPlaces)
    merge_reach: float = 2.0
    merge_limit: float = np.inf
    remove_limit: float = np.inf
    least: float = 0.75
    lap: float = 4.0
    nearby: int = 3

    @property
    def name(self) -> str:
        """union-rect"""
        return "union-rect"

    def axiom(self, canvas: Canvas) -> Program[Structure]:
        """The paper's rectangle: two thirds of the canvas' half-sizes."""
        ex, ey = (2 * side / 3 for side in canvas.extent)
        return program_of(np.array([[0.0, 0.0, ex, ey, 0.0]]))

    def complexity(self, program: Program[Structure]) -> float:
        """Number of rectangles."""
        return program.structure.count

    def primitives(self, program: Program[Structure]) -> int:
        """Number of rectangles."""
        return program.structure.count

    def growth(self, program: Program[Structure], rewrite: Rewrite) -> float:
        """Change of the number of rectangles."""
        exchange = self.exchange(rects_of(program), rewrite)
        return len(exchange.new) - len(exchange.gone)

    def rasterize(self, program: Program[Structure], canvas: Canvas) -> Band:
        """Coverage and its derivative by the program's parameters."""
        rects = _on(rects_of(program), canvas)
        band = scan(rects, 0, canvas.height, 0, canvas.width, canvas.ramp)
        moved = slopes(rects, band, canvas.ramp, 1 / canvas.pixel, len(rects))
        row, col, cover, wound, rect, slope = entries(band, *moved)
        size = program.structure.size
        columns = np.arange(size, dtype=np.int64).reshape(-1, NUMBERS)
        return Band(canvas.shape, row, col, cover, wound, rect, slope, columns, band[6], size)

    def repair(self, program: Program[Structure]) -> Edit[Structure]:
        """The same union without rectangles or parts of them that others cover."""
        if not np.isfinite(program.params).all():
            raise GrammarError("a Union-Rect program needs finite parameters, got NaN or infinity")
        rects = rects_of(program)
        kept, origin, changed = repair(to_pixels(rects, 1 / self.pixel), self.least, self.lap)
        if not changed and np.array_equal(rects.ravel(), program.params):
            return Edit(program, np.arange(program.structure.size))
        numbers = (NUMBERS * origin[:, None] + np.arange(NUMBERS)).ravel()
        return Edit(program_of(to_world(kept, 1 / self.pixel) if changed else rects), numbers)

    def rewrites(
        self, program: Program[Structure], demand: Floats, canvas: Canvas, rng: np.random.Generator
    ) -> list[Rewrite]:
        """All rewrites of the enabled rules whose guards allow them."""
        rects = rects_of(program)
        count = len(rects)
        found = []
        for rule in ("split-h", "split-v"):
            for i in range(count):
                for share in self.places.shares(rng):
                    found.append(Rewrite(rule, frozenset((i,)), (float(i), share)))
        if count > 1:
            for i in np.flatnonzero(rects[:, 2] * rects[:, 3] <= self.remove_limit).tolist():
                found.append(Rewrite("remove", frozenset((i,)), (float(i),)))
        if "merge" in self.rules:
            for i, j in near(rects, self.merge_reach):
                if np.isinf(self.merge_limit) or merge_gain(rects, i, j) <= self.merge_limit:
                    found.append(Rewrite("merge", frozenset((i, j)), (float(i), float(j))))
        inside = self.rasterize(program, canvas).coverage
        fill, empty = self.places.boxes(demand, inside, canvas, rng, count)
        found += [Rewrite("add-rect", frozenset(), box) for box in fill]
        found += [Rewrite("add-hole", frozenset(), box) for box in empty]
        return [rewrite for rewrite in found if rewrite.rule in self.rules]

    def exchange(self, rects: Floats, rewrite: Rewrite) -> Exchange:
        """What a rewrite does to rectangles (n, 5)."""
        if rewrite.fit is not None:
            return Exchange(tuple(sorted(rewrite.sites)), rewrite.fit.reshape(-1, NUMBERS))
        data = rewrite.data
        if rewrite.rule in ("split-h", "split-v"):
            return split(rects, int(data[0]), int(rewrite.rule == "split-v"), data[1], self.lap * self.pixel)
        if rewrite.rule == "merge":
            return merge(rects, int(data[0]), int(data[1]))
        if rewrite.rule == "remove":
            return remove(rects, int(data[0]))
        return add(np.array(data)) if rewrite.rule == "add-rect" else hole(rects, np.array(data))

    def apply(self, program: Program[Structure], rewrites: Sequence[Rewrite]) -> Edit[Structure]:
        """Apply rewrites at disjoint sites; then holes in what those leave, then new rectangles (SPEC 4.4).

        If nothing would remain the program is returned unchanged.
        """
        rects = rects_of(program)
        origin = np.arange(len(rects))
        alive = np.ones(len(rects), np.bool_)
        late = [r for r in rewrites if r.fit is None and r.rule in ("add-hole", "add-rect")]
        new: list[Floats] = []
        for rewrite in rewrites:
            if not any(rewrite is other for other in late):
                exchange = self.exchange(rects, rewrite)
                alive[list(exchange.gone)] = False
                new.append(exchange.new)
        rects = np.concatenate([rects[alive], *new])
        origin = np.concatenate([origin[alive], np.full(len(rects) - int(alive.sum()), -1)])
        for rewrite in sorted(late, key=lambda r: r.rule):
            exchange = self.exchange(rects, rewrite)
            keep = np.ones(len(rects), np.bool_)
            keep[list(exchange.gone)] = False
            rects = np.concatenate([rects[keep], exchange.new])
            origin = np.concatenate([origin[keep], np.full(len(exchange.new), -1)])
        if len(rects) == 0:
            return Edit(program, np.arange(program.structure.size))
        numbers = NUMBERS * origin[:, None] + np.arange(NUMBERS)
        return Edit(program_of(rects), np.where(origin[:, None] >= 0, numbers, -1).ravel())

    def local_trials(
        self,
        program: Program[Structure],
        rewrites: Sequence[Rewrite],
        loss: Any,
        canvas: Canvas,
        price: float,
        steps: int,
    ) -> list[Trial]:
        """Each rewrite with the rectangles that at most ``steps`` local steps find for it, and what it gains."""
        world = rects_of(program)
        rects = _on(world, canvas)
        picture = Picture(loss.table.target, loss.table.runs, loss.table.squares, 0.0)
        found = []
        for rewrite in rewrites:
            exchange = self.exchange(world, rewrite)
            growth = len(exchange.new) - len(exchange.gone)
            if rewrite.rule == "remove":
                exchange = self._with_neighbours(world, exchange)
            if len(exchange.gone) == len(world) and len(exchange.new) == 0:
                continue
            gone = np.array(exchange.gone, np.int64)
            cost = price * canvas.size * growth
            gain, fitted = trial(rects, gone, _on(exchange.new, canvas), cost, picture, canvas.ramp, steps)
            if gain > 0:
                fit = to_world(fitted, 1 / canvas.pixel, canvas.width / 2, canvas.height / 2).ravel()
                sites = frozenset(exchange.gone)
                found.append(Trial(Rewrite(rewrite.rule, sites, rewrite.data, fit), gain / canvas.size))
        return found

    def _with_neighbours(self, rects: Floats, exchange: Exchange) -> Exchange:
        """An exchange that takes up the nearest rectangles too, to be fitted again."""
        (i,) = exchange.gone
        apart = np.hypot(*(rects[:, :2] - rects[i, :2]).T) - np.hypot(rects[:, 2], rects[:, 3])
        apart[i] = np.inf
        others = np.sort(np.argsort(apart, kind="stable")[: min(self.nearby, len(rects) - 1)])
        return Exchange((i, *others.tolist()), rects[others])

    def outline(self, program: Program[Structure]) -> Sketch:
        """The boundary of the union as an exact sketch in world units."""
        return union(rects_of(program), GRAIN * self.pixel)

    def rectangles(self, program: Program[Structure]) -> tuple[Sketch, ...]:
        """Every rectangle as a sketch of its own, in world units; they lap over each other."""
        return separate(rects_of(program))

    def encode(self, structure: Structure) -> Any:
        """The number of rectangles."""
        return {"rectangles": structure.count}

    def decode(self, value: Any) -> Structure:
        """The structure from {"rectangles": count}."""
        count = value.get("rectangles") if isinstance(value, dict) else None
        if not isinstance(count, int) or isinstance(count, bool):
            raise GrammarError(f'a Union-Rect structure is {{"rectangles": count}}, got {value!r}')
        return Structure(count)


def _on(rects: Floats, canvas: Canvas) -> Floats:
    """Rectangles in the canvas' pixels."""
    return to_pixels(rects, 1 / canvas.pixel, canvas.width / 2, canvas.height / 2)
