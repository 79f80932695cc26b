"""The Tree grammar: a union of leaves on the nodes of a tree whose branches turn by limited angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from d4cad.canvas import Canvas
from d4cad.errors import GrammarError
from d4cad.grammars.tree.facts import FACTS
from d4cad.grammars.tree.kinematics import Kinematics, on_canvas, poses_of
from d4cad.grammars.tree.leaves import LEAVES, POINTED, Leaf
from d4cad.grammars.tree.outline import union
from d4cad.grammars.tree.places import DemandPlaces, Places, shape_bottom
from d4cad.grammars.tree.raster import scan, slopes
from d4cad.grammars.tree.rules import (
    LEAST_NODES,
    MOST_CHILDREN,
    Nodes,
    add_chain,
    chain_lengths,
    chain_to,
    drop_small,
    joined,
    remove_branch,
    remove_leaf,
    shoots,
    split,
)
from d4cad.grammars.tree.structure import Limits, Structure, bounds, program_of, table_of
from d4cad.grammars.tree.workbench import Workbench
from d4cad.program import Edit, Floats, Program, Rewrite
from d4cad.protocols import Trial
from d4cad.raster.band import NUMBERS, Band

if TYPE_CHECKING:
    from d4cad.sketch import Sketch

BOTTOMS = ("frame", "shape")
"""Where the root of the axiom may be: at the bottom of the canvas, or of the shape in the target."""
FIRST_BRANCH = 0.1
"""Length of the axiom's only branch."""
LEAST_SHARE = 0.01
"""Least share of a branch that a split leaves to either part."""


@dataclass(frozen=True, slots=True)
class Tree:
    """Leaves on a tree.

    rules: the names of the rewrites in use. limits, leaf: of the axiom, which its programs keep. places: where
    chains of nodes are proposed to lead, each from the ``reach`` nodes that get there with the fewest. bottom: one of
    BOTTOMS; seat: the root's place if known, else that of the canvas' bottom. sprout: branch length of a new leaf;
    size: its leaf size, and that of the axiom's. tip, link: leaf sizes of the last node of a new chain and of those
    before. epsilon: where a split cuts, from the parent, and the branch length or leaf size up to which a leaf may be
    removed if ``guarded``. least: repair drops childless nodes with smaller leaves. All lengths in world units.
    """

    rules: frozenset[str] = frozenset(FACTS)
    limits: Limits = field(default_factory=Limits)
    leaf: Leaf = POINTED
    places: Places = field(default_factory=DemandPlaces)
    reach: int = 3
    bottom: str = "frame"
    seat: tuple[float, float] | None = None
    sprout: float = 0.03
    size: float = 0.075
    tip: float = 0.03
    link: float = 0.0
    epsilon: float = 0.03
    guarded: bool = False
    least: float = 0.01

    @property
    def name(self) -> str:
        """tree"""
        return "tree"

    def made_for(self, target: Floats, canvas: Canvas) -> Tree:
        """The grammar with its axiom where ``bottom`` says for a target (height, width) on ``canvas``."""
        return replace(self, seat=shape_bottom(target, canvas)) if self.bottom == "shape" else self

    def axiom(self, canvas: Canvas) -> Program[Structure]:
        """A root and one branch upward."""
        root = self.seat or (0.0, -canvas.extent[1])
        size = min(self.size, self.limits.size)
        table = np.array([[0.0, 0.0, size], [min(FIRST_BRANCH, self.limits.length), 0.0, size]])
        return program_of(Structure((-1, 0), root, self.limits, self.leaf), table)

    def complexity(self, program: Program[Structure]) -> float:
        """Number of nodes besides the root."""
        return len(program.structure.parents) - 1

    def primitives(self, program: Program[Structure]) -> int:
        """Number of nodes."""
        return len(program.structure.parents)

    def growth(self, program: Program[Structure], rewrite: Rewrite) -> float:
        """Change of the number of nodes."""
        if rewrite.rule == "add-anywhere":
            return rewrite.data[1]
        return -1.0 if rewrite.rule.startswith("remove") else 1.0

    def rasterize(self, program: Program[Structure], canvas: Canvas) -> Band:
        """Coverage, its derivative by the leaves' poses, and the kinematics by which parameters move those."""
        pose = poses_of(program)
        on = on_canvas(pose, canvas)
        leaf = program.structure.leaf
        excess, offset = leaf.excess, leaf.offset
        row, col, cover, wound, piece, spans = scan(on, excess, offset, 0, canvas.height, 0, canvas.width, canvas.ramp)
        slope = slopes(on, excess, offset, row, col, piece, canvas.ramp, 1 / canvas.pixel)
        columns = np.full((len(pose), NUMBERS), -1, np.int64)
        columns[:, :4] = np.arange(4 * len(pose)).reshape(-1, 4)
        chain = Kinematics(program.structure.parent, pose)
        return Band(canvas.shape, row, col, cover, wound, piece, slope, columns, spans, 4 * len(pose), chain=chain)

    def repair(self, program: Program[Structure]) -> Edit[Structure]:
        """The parameters within their limits, without childless nodes of small leaves."""
        if not np.isfinite(program.params).all():
            raise GrammarError("a Tree program needs finite parameters, got NaN or infinity")
        kept = np.clip(program.params, *bounds(program))
        if not np.array_equal(kept, program.params):
            program = program.moved(kept)
        elif not self._has_small(program):
            return Edit(program, np.arange(program.structure.size))
        nodes = Nodes.of(program)
        drop_small(nodes, self.least)
        return nodes.edit()

    def _has_small(self, program: Program[Structure]) -> bool:
        small = (table_of(program)[:, 2] < self.least) & (program.structure.children == 0)
        return bool(small[1:].any())

    def rewrites(
        self, program: Program[Structure], demand: Floats, canvas: Canvas, rng: np.random.Generator
    ) -> list[Rewrite]:
        """All rewrites of the enabled rules whose guards allow them."""
        table = table_of(program)
        nodes = Nodes.of(program)
        limits = program.structure.limits
        found = []
        for i, below in enumerate(nodes.children):
            for side in (1.0, -1.0) if not below else (1.0,) if len(below) == 1 and table[below[0], 1] < 0 else (-1.0,):
                if len(below) < MOST_CHILDREN:
                    data = (float(i), self.sprout, side * limits.angle, min(self.size, limits.size))
                    found.append(Rewrite("add-leaf", frozenset((i,)), data))
        for i in range(1, len(table)):
            share = min(max(self.epsilon / max(table[i, 0], 1e-9), LEAST_SHARE), 1 - LEAST_SHARE)
            found.append(Rewrite("split", frozenset((i,)), (float(i), share)))
        if nodes.count >= LEAST_NODES:
            for i in range(1, len(table)):
                small = table[i, 0] <= self.epsilon or table[i, 2] <= self.epsilon
                if not nodes.children[i] and (small or not self.guarded):
                    found.append(Rewrite("remove-leaf", frozenset((i,)), (float(i),)))
                elif joined(nodes, i) is not None:
                    found.append(Rewrite("remove-branch", frozenset((i, nodes.children[i][0])), (float(i),)))
        if "add-anywhere" in self.rules:
            found += self._chains(program, self.places(demand, canvas, limits, len(table), rng))
        return [rewrite for rewrite in found if rewrite.rule in self.rules]

    def _chains(self, program: Program[Structure], places: Sequence[tuple[float, float, float]]) -> list[Rewrite]:
        pose = poses_of(program)
        limits = program.structure.limits
        full = program.structure.children >= MOST_CHILDREN
        found = []
        for x, y, size in places:
            lengths = np.where(full, np.inf, chain_lengths(pose, (x, y), limits))
            for i in np.argsort(lengths, kind="stable")[: self.reach].tolist():
                if not isfinite(lengths[i]):
                    break
                count, length, turn = chain_to(pose[i], (x, y), float(lengths[i]), limits)
                if count:
                    tip, link = (size, size) if size > 0 else (self.tip, self.link)
                    data = (float(i), float(count), length, turn, tip, link)
                    found.append(Rewrite("add-anywhere", frozenset((i,)), data))
        return found

    def apply(self, program: Program[Structure], rewrites: Sequence[Rewrite]) -> Edit[Structure]:
        """Apply rewrites at disjoint sites, in their order, each with its fitted values if it carries some; one whose
        guard no longer holds is left out."""
        nodes = Nodes.of(program)
        for rewrite in rewrites:
            i = int(rewrite.data[0])
            if rewrite.rule == "split":
                share, size = (rewrite.data[1], None) if rewrite.fit is None else rewrite.fit
                split(nodes, i, float(share), None if size is None else float(size))
            elif rewrite.rule == "remove-leaf":
                remove_leaf(nodes, i)
            elif rewrite.rule == "remove-branch":
                remove_branch(nodes, i)
            else:
                add_chain(nodes, i, shoots(rewrite))
        return nodes.edit()

    def local_trials(
        self,
        program: Program[Structure],
        rewrites: Sequence[Rewrite],
        loss: Any,
        canvas: Canvas,
        price: float,
        steps: int,
    ) -> list[Trial]:
        """Each rewrite with the numbers that at most ``steps`` local steps find for its new nodes, and its gain."""
        bench = Workbench.of(self.size, program, loss.table.target, canvas, price, steps)
        found: list[Trial] = []
        leaves = sorted({int(r.data[0]) for r in rewrites if r.rule == "add-leaf"})
        if leaves:
            found += bench.leaves(leaves)
        for rewrite in rewrites:
            if rewrite.rule == "add-anywhere":
                found += bench.chain(rewrite)
            elif rewrite.rule == "split":
                found += bench.split(rewrite)
            elif rewrite.rule != "add-leaf":
                found += bench.removal(rewrite)
        return found

    def outline(self, program: Program[Structure], branches: float = 0.0) -> Sketch:
        """The exact union of the leaves in world units, and of branches of the width ``branches`` if that is not 0, by
        which all leaves hold together."""
        return union(program.structure.parents, poses_of(program), program.structure.leaf, branches)

    def encode(self, structure: Structure) -> Any:
        """Parents, the root's place, the limits and the leaf's name."""
        limits = structure.limits
        return {
            "leaf": next(name for name, leaf in LEAVES.items() if leaf == structure.leaf),
            "parents": list(structure.parents),
            "root": list(structure.root),
            "limits": {
                "length": limits.length, "angle": limits.angle, "size": limits.size, "sized": limits.sized,
            },
        }  # fmt: skip

    def decode(self, value: Any) -> Structure:
        """The structure back from what :meth:`encode` gives."""
        wrong = GrammarError(f"a Tree structure is an object of leaf, parents, root and limits, got {str(value)[:80]}")
        try:
            leaf, parents, (x, y) = LEAVES[value["leaf"]], value["parents"], value["root"]
            limits = Limits(**value["limits"])
        except (TypeError, ValueError, KeyError):
            raise wrong from None
        numbers = (x, y, limits.length, limits.angle, limits.size)
        if not (isinstance(parents, list) and all(type(p) is int for p in parents) and type(limits.sized) is bool):
            raise wrong
        if not all(type(v) in (int, float) and isfinite(v) for v in numbers) or min(numbers[2:]) < 0:
            raise wrong
        return Structure(tuple(parents), (float(x), float(y)), limits, leaf)
