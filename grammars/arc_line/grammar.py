"""The Arc-Line grammar: closed loops of lines and circular arcs under the non-zero rule."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from d4cad.canvas import Canvas
from d4cad.errors import GrammarError
from d4cad.grammars.arc_line.joints import JOINTS, joint_rewrites, joint_trials, tied_at
from d4cad.grammars.arc_line.places import DemandPlaces, Places
from d4cad.grammars.arc_line.repair import compact, repair
from d4cad.grammars.arc_line.rules import NEW_VERTICES, Rule, candidates, rewrite, touched
from d4cad.grammars.arc_line.scene import Linked, Picture
from d4cad.grammars.arc_line.structure import (
    Shape,
    Structure,
    followers,
    from_shape,
    parameter_origin,
    still_smooth,
    to_shape,
)
from d4cad.grammars.arc_line.tangency import kinks, smoothed
from d4cad.grammars.arc_line.trials import trials
from d4cad.grammars.arc_line.wholes import circles, slits
from d4cad.program import Edit, Floats, Program, Rewrite
from d4cad.protocols import Trial
from d4cad.raster.band import Band
from d4cad.raster.scan import scan

if TYPE_CHECKING:
    from d4cad.loop import Loop
    from d4cad.sketch import Sketch

NAMES = {int(rule): rule.name.lower().replace("_", "-") for rule in Rule}
"""Names of the rules by their numbers, which are what the kernels take."""
RULES = {name: rule for rule, name in NAMES.items()}
"""Numbers of the rules by their names, those of joints excepted."""


@dataclass(frozen=True, slots=True)
class ArcLine:
    """Loops of lines and arcs.

    pixel: the world length that counts as one pixel in guards and repair. rules: the names of the rewrites in use.
    places: where new loops are proposed. lossy: a merge or removal is proposed if it moves the outline by at most so
    many pixels as the guards estimate it; the trial decides. slit: the greatest width in pixels of a slit or thin wall
    that a pinch closes. arc_weight: the complexity of an arc, a line's being 1: it has three numbers where a line has
    two.
    """

    pixel: float = 3 / 256
    rules: frozenset[str] = frozenset((*RULES, *JOINTS))
    places: Places = field(default_factory=DemandPlaces)
    lossy: float = 12.0
    slit: float = 3.0
    arc_weight: float = 1.5
    joint_weight: float = 0.5

    @property
    def name(self) -> str:
        """arc-line"""
        return "arc-line"

    def axiom(self, canvas: Canvas) -> Program[Structure]:
        """The paper's diamond, with corners at two thirds of the canvas' half-sizes."""
        ex, ey = (2 * side / 3 for side in canvas.extent)
        return Program(Structure((4,), (False,) * 4), np.array([ex, 0.0, 0.0, ey, -ex, 0.0, 0.0, -ey]))

    def drawn(self, loops: Sequence[Loop]) -> Program[Structure]:
        """The program of loops in world units, the inside on their left."""
        bulges = [b for loop in loops for b in loop.bulges]
        points = [number for loop in loops for point in loop.points for number in point]
        structure = Structure(tuple(len(loop.bulges) for loop in loops), tuple(b != 0 for b in bulges))
        return Program(structure, np.array([*points, *(b for b in bulges if b != 0)]))

    def complexity(self, program: Program[Structure]) -> float:
        """Number of edges, arcs counted by their weight, less that of the smooth joints."""
        structure = program.structure
        return (
            len(structure.arcs)
            + (self.arc_weight - 1) * sum(structure.arcs)
            - self.joint_weight * len(structure.smooth)
        )

    def primitives(self, program: Program[Structure]) -> int:
        """Number of edges."""
        return len(program.structure.arcs)

    def growth(self, program: Program[Structure], rewrite: Rewrite) -> float:
        """Change of the complexity, smooth joints that a change of their edges ends not counted."""
        arcs, arc = program.structure.arcs, self.arc_weight
        i = int(rewrite.data[0])
        if rewrite.rule in JOINTS:
            smooth, layout = program.structure.smooth, program.structure.layout
            tied = set(tied_at(rewrite.rule, i, layout)) - set(smooth)
            change = 1.0 if rewrite.rule == "sharpen" else -float(len(tied))
            if rewrite.rule == "bridge":
                return 1 - 2 * self.joint_weight
            if rewrite.rule == "bend":
                return self.joint_weight * change + arc - 1
            if rewrite.rule == "straighten":
                lost = [
                    v for v, e in ((i, layout.prv[i]), (layout.nxt[i], layout.nxt[i])) if not arcs[e] and v in smooth
                ]
                return self.joint_weight * (change + len(lost)) + 1 - arc
            return self.joint_weight * change
        rule = RULES[rewrite.rule]
        if rule == Rule.ADD_LOOP:
            return 4 * arc
        here = arc if arcs[i] else 1.0
        if rule == Rule.SPLIT or rule == Rule.CLOSE:
            return here if rule == Rule.SPLIT else -here
        if rule == Rule.TO_ARC or rule == Rule.TO_LINE:
            return (arc if rule == Rule.TO_ARC else 1.0) - here
        if rule == Rule.SPLIT_LINES:
            return 2.0 - here
        if rule == Rule.ROUND or rule == Rule.CHAMFER:
            return arc if rule == Rule.ROUND else 1.0
        if rule == Rule.SPLIT_THREE:
            return 3.0 - here
        if rule == Rule.REMOVE_LOOP or rule == Rule.CIRCLE:
            return (2 * arc if rule == Rule.CIRCLE else 0.0) - sum(arc if arcs[k] else 1.0 for k in rewrite.sites)
        if rule == Rule.PINCH:
            return self.complexity(self.apply(program, [rewrite]).program) - self.complexity(program)
        before = arc if arcs[program.structure.layout.prv[i]] else 1.0
        return (arc if rule == Rule.MERGE_ARC else 1.0) - here - before

    def rasterize(self, program: Program[Structure], canvas: Canvas) -> Band:
        """Coverage and its derivative by the program's parameters."""
        layout = program.structure.layout
        shape = _on(program, canvas)
        row, col, cover, wound, edge, slope, spans = scan(
            shape.x, shape.y, shape.b, shape.nxt, 0, canvas.height, 0, canvas.width, canvas.ramp, 1 / canvas.pixel
        )
        return Band(canvas.shape, row, col, cover, wound, edge, slope, layout.columns, spans, layout.size)

    def repair(self, program: Program[Structure]) -> Edit[Structure]:
        """Loops that do not cross and have their inside on the left, bounding the same non-zero region."""
        layout = program.structure.layout
        if not np.isfinite(program.params).all():
            raise GrammarError("an Arc-Line program needs finite parameters, got NaN or infinity")
        shape = to_shape(program, 1 / self.pixel)
        x, y, b, arc, sizes, vertex, edge, changed = repair(*shape)
        if not changed:
            return Edit(program, np.arange(layout.size))
        smooth = still_smooth(vertex, edge, followers(sizes), layout.smooth, layout)
        mended = from_shape(Shape(x, y, b, arc, layout.nxt), sizes, 1 / self.pixel, smooth=smooth)
        return Edit(mended, parameter_origin(vertex, edge, arc, layout))

    def rewrites(
        self, program: Program[Structure], demand: Floats, canvas: Canvas, rng: np.random.Generator
    ) -> list[Rewrite]:
        """All rewrites of the enabled rules whose guards allow them."""
        shape = to_shape(program, 1 / self.pixel)
        sizes = np.repeat(program.structure.sizes, program.structure.sizes)
        rules, sites, marks = candidates(*shape, program.structure.layout.prv, sizes, self.lossy)
        found = []
        for rule, site, touches in zip(rules.tolist(), sites.tolist(), marks.tolist(), strict=True):
            if NAMES[rule] in self.rules:
                sites_of = frozenset(s for s in (site, *touches) if 0 <= s < len(shape.x))
                found.append(Rewrite(NAMES[rule], sites_of, (float(site),)))
        if "pinch" in self.rules:
            pairs = slits(shape.x, shape.y, shape.b, shape.nxt, self.slit)
            for i, j, points in zip(*(part.tolist() for part in pairs), strict=True):
                ends = frozenset((i, j, int(shape.nxt[i]), int(shape.nxt[j])))
                found.append(Rewrite("pinch", ends, (float(i), float(j), *map(float, points))))
        found += self.ties(program)
        found += self._whole_loops(program, shape)
        if "add-loop" in self.rules:
            inside = self.rasterize(program, canvas).coverage
            found += [
                Rewrite("add-loop", frozenset(), (0.0, *place)) for place in self.places(demand, inside, canvas, rng)
            ]
        return found

    def _whole_loops(self, program: Program[Structure], shape: Shape) -> list[Rewrite]:
        """Loops to be removed, or to become circles."""
        ends = np.cumsum(program.structure.sizes)
        starts = ends - program.structure.sizes
        round_ones = circles(shape.x, shape.y, shape.b, shape.nxt, starts)
        found = []
        for start, end, (x, y, radius) in zip(starts.tolist(), ends.tolist(), round_ones.tolist(), strict=True):
            sites = frozenset(range(start, end))
            if "circle" in self.rules and radius != 0 and end - start > 2:
                data = (float(start), x * self.pixel, y * self.pixel, radius * self.pixel)
                found.append(Rewrite("circle", sites, data))
            if "remove-loop" in self.rules and len(starts) > 1:
                found.append(Rewrite("remove-loop", sites, (float(start),)))
        return found

    def apply(self, program: Program[Structure], rewrites: Sequence[Rewrite]) -> Edit[Structure]:
        """Apply rewrites at disjoint sites, each with its fitted values if it carries some."""
        layout = program.structure.layout
        shape = to_shape(program, 1 / self.pixel)
        n, room = len(shape.x), len(shape.x) + NEW_VERTICES * len(rewrites)
        x, y, b, arc, nxt = (np.concatenate([part, np.zeros(room - n, part.dtype)]) for part in shape)
        nxt[n:] = np.arange(n, room)
        prv = np.concatenate([program.structure.layout.prv, np.arange(n, room)])
        used = n
        vertices, edges = np.empty(4, np.int64), np.empty(4, np.int64)
        fresh_b: list[int] = []
        joints, tied = set(program.structure.smooth), set[int]()
        for item in rewrites:
            site = int(item.data[0])
            if item.rule in JOINTS:
                joints.difference_update([site] if item.rule == "sharpen" else [])
                tied |= set(tied_at(item.rule, site, layout))
                if item.rule == "bridge":
                    tied.add(used)
                    used = rewrite(int(Rule.CHAMFER), site, np.zeros(3), x, y, b, arc, nxt, prv, used)
                elif item.rule == "bend":
                    arc[site], b[site] = True, item.data[1]
                elif item.rule == "straighten":
                    arc[site], b[site] = False, 0.0
                    # A joint of two lines is none.
                    joints -= {v for v in (site, int(nxt[site])) if not (arc[v] or arc[prv[v]])}
                continue
            rule, data = RULES[item.rule], _data(item, 1 / self.pixel)
            free, own = touched(rule, site, data, nxt, prv, used, vertices, edges)
            used = rewrite(rule, site, data, x, y, b, arc, nxt, prv, used)
            if item.fit is not None:
                x[vertices[:free]], y[vertices[:free]] = item.fit[0 : 2 * free : 2], item.fit[1 : 2 * free : 2]
                # The edges beside it were tuned as they stood: in a set, another rewrite may have changed their kind.
                beside = [e for v in vertices[:free] for e in (v, prv[v])] if len(rewrites) == 1 else []
                bent = [e for e in dict.fromkeys([*edges[:own].tolist(), *beside]) if arc[e]]
                b[bent] = item.fit[2 * free : 2 * free + len(bent)]
            fresh_b += [int(e) for e in edges[:own]]
        keep = nxt[:used] != np.arange(used)
        if not keep.any():
            return Edit(program, np.arange(layout.size))
        place = np.arange(used)
        same_edge = np.where(place < n, place, -1)
        same_edge[[e for e in fresh_b if e < used]] = -1
        x, y, b, arc, _, place, edge, sizes = compact(
            x[:used], y[:used], b[:used], arc[:used], nxt[:used], place, same_edge, keep
        )
        vertex = np.where(place < n, place, -1)
        smooth = still_smooth(vertex, edge, followers(sizes), np.array(sorted(joints), np.int64), layout)
        smooth = tuple(sorted({*smooth, *np.flatnonzero(np.isin(place, list(tied))).tolist()}))
        changed = from_shape(Shape(x, y, b, arc, nxt), sizes, 1 / self.pixel, smooth=smooth)
        return Edit(changed, parameter_origin(vertex, edge, arc, layout))

    def local_trials(
        self,
        program: Program[Structure],
        rewrites: Sequence[Rewrite],
        loss: Any,
        canvas: Canvas,
        price: float,
        steps: int,
    ) -> list[Trial]:
        """Each rewrite with the values that at most ``steps`` local steps find for it, and what it gains.

        The gain of smooth joints is that of the whole program by its linearisation.
        """
        joints = [rewrite for rewrite in rewrites if rewrite.rule in JOINTS]
        found = []
        if joints:
            evaluation = loss.evaluate(self.rasterize(program, canvas))
            found = joint_trials(program, joints, evaluation, price, [self.growth(program, r) for r in joints])
        rewrites = [rewrite for rewrite in rewrites if rewrite.rule not in JOINTS]
        if not rewrites:
            return found
        middle = np.array([canvas.width / 2, canvas.height / 2, 0.0])
        rules = np.array([RULES[r.rule] for r in rewrites], np.int64)
        data = np.array([(*r.data, 0.0, 0.0, 0.0)[:4] for r in rewrites])
        sites = data[:, 0].astype(np.int64)
        data = np.where(
            np.isin(rules, (Rule.ADD_LOOP, Rule.CIRCLE))[:, None], data[:, 1:] / canvas.pixel + middle, data[:, 1:]
        )
        costs = price * canvas.size * np.array([self.growth(program, r) for r in rewrites])
        loops = Linked(*_on(program, canvas), program.structure.layout.prv)
        picture = Picture(loss.table.target, loss.table.runs, loss.table.squares, loss.table.slack)
        gain, free, fit = trials(rules, sites, data, costs, loops, picture, canvas.ramp, steps)
        # Places of vertices to the grammar's pixels; bulges, behind them, stay as they are.
        places = (fit - np.resize(middle[:2], fit.shape[1])) * (canvas.pixel / self.pixel)
        fit = np.where(np.arange(fit.shape[1]) < 2 * free[:, None], places, fit)
        return found + [
            Trial(Rewrite(rewrites[k].rule, rewrites[k].sites, rewrites[k].data, fit[k]), float(gain[k]) / canvas.size)
            for k in np.flatnonzero(gain > 0).tolist()
        ]

    @property
    def binding(self) -> frozenset[str]:
        """The rules of smooth joints."""
        return self.rules & frozenset(JOINTS)

    def ties(self, program: Program[Structure]) -> list[Rewrite]:
        """The rewrites that make or free bonds and leave the shape nearly as it is."""
        return [rewrite for rewrite in joint_rewrites(program, self.pixel) if rewrite.rule in self.rules]

    def bonds(self, program: Program[Structure]) -> tuple[Floats, Floats]:
        """The kinks at the smooth joints in radians, (k,), and their derivatives (k, n)."""
        return kinks(program, program.structure.layout.smooth)

    def tightened(self, program: Program[Structure]) -> Program[Structure]:
        """The program with its smooth joints exactly smooth."""
        return smoothed(program)

    def outline(self, program: Program[Structure]) -> Sketch:
        """The loops as an exact sketch in world units."""
        from d4cad.sketch import Loop, Sketch

        shape = to_shape(program)
        loops, start = [], 0
        for size in program.structure.sizes:
            part = slice(start, start + size)
            points = tuple(zip(shape.x[part].tolist(), shape.y[part].tolist(), strict=True))
            loops.append(Loop(points, tuple(shape.b[part].tolist())))
            start += size
        return Sketch.from_loops(loops, "world")

    def encode(self, structure: Structure) -> Any:
        """Each loop as a word: L for a line, A for an arc, in lower case where it starts at a smooth joint."""
        letters = ["A" if arc else "L" for arc in structure.arcs]
        for i in structure.smooth:
            letters[i] = letters[i].lower()
        ends = np.cumsum((0, *structure.sizes))
        return ["".join(letters[a:b]) for a, b in pairwise(ends)]

    def decode(self, value: Any) -> Structure:
        """The structure from its words."""
        if (
            not isinstance(value, list)
            or not value
            or not all(isinstance(w, str) and set(w) <= {"L", "A", "l", "a"} for w in value)
        ):
            raise GrammarError(f"an Arc-Line structure is a list of words of L and A, got {value!r}")
        letters = "".join(value)
        smooth = tuple(i for i, letter in enumerate(letters) if letter.islower())
        return Structure(tuple(len(word) for word in value), tuple(x in "Aa" for x in letters), smooth)


def _on(program: Program[Structure], canvas: Canvas) -> Shape:
    """The program's loops in the canvas' pixels."""
    return to_shape(program, 1 / canvas.pixel, canvas.width / 2, canvas.height / 2)


def _data(item: Rewrite, scale: float) -> Floats:
    """The numbers of a rewrite as the kernels take them, (3,): a circle in pixels, or an edge."""
    if item.rule in ("add-loop", "circle"):
        return np.array(item.data[1:]) * scale
    return np.array([*item.data[1:], 0.0, 0.0, 0.0][:3])
