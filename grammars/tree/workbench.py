"""Trials of a tree's rewrites against one base."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from d4cad.canvas import Canvas
from d4cad.grammars.tree.kinematics import on_canvas, poses, poses_of
from d4cad.grammars.tree.raster import layers
from d4cad.grammars.tree.rules import shoots
from d4cad.grammars.tree.structure import Structure
from d4cad.grammars.tree.trials import best_shoots, fit_chain, losses
from d4cad.program import Floats, Program, Rewrite
from d4cad.protocols import Trial

TILE = 12
"""Side in pixels of the squares of which trials that draw in one of them exclude each other."""
STARTS = (0.25, 0.5, 1.0)
"""First guesses of a trial's branch length, as shares of the limit."""


@dataclass(frozen=True, slots=True, eq=False)
class Workbench:
    """A program prepared for trials: its leaves' poses in pixels, its coverage, and what each leaf alone covers.

    size: that of new leaves in world units where sizes are fixed. pose: (n, 4) in pixels.
    covered: (height, width) coverage. loss: (n,) by how much the squared error grows without each leaf. cost: squared
    error that a node must earn. scale: world units of a pixel for lengths, of a radian for angles, of a pixel for
    sizes, (3,). most: (3,) limits in pixels and radians.
    """

    size: float
    program: Program[Structure]
    target: Floats
    pose: Floats
    covered: Floats
    loss: Floats
    cost: float
    scale: Floats
    most: Floats
    ramp: float
    steps: int

    @classmethod
    def of(
        cls,
        size: float,
        program: Program[Structure],
        target: Floats,
        canvas: Canvas,
        price: float,
        steps: int,
    ) -> Workbench:
        """Draw the program once."""
        pose = on_canvas(poses_of(program), canvas)
        leaf = program.structure.leaf
        best, second, owner = layers(pose, leaf.excess, leaf.offset, canvas.height, canvas.width, canvas.ramp)
        limits = program.structure.limits
        scale = np.array([canvas.pixel, 1.0, canvas.pixel])
        return cls(
            size=size,
            program=program,
            target=target,
            pose=pose,
            covered=best,
            loss=losses(best, second, owner, target, len(pose)),
            cost=price * canvas.size,
            scale=scale,
            most=np.array([limits.length, limits.angle, limits.size]) / scale,
            ramp=canvas.ramp,
            steps=steps,
        )

    def leaves(self, nodes: Sequence[int]) -> list[Trial]:
        """The best new leaf of each node that pays."""
        angle, size = self.most[1:]
        guess = size if self.program.structure.limits.sized else self.size / self.scale[2]
        starts = np.array(
            [(share * self.most[0], turn, part * guess)
             for share in STARTS for turn in (-angle, 0.0, angle) for part in ((0.5, 1.0) if guess == size else (1.0,))]
        )  # fmt: skip
        structure = self.program.structure
        gains, best = best_shoots(
            np.array(nodes, np.int64), self.pose, starts, self.most, structure.limits.sized,
            self.covered, self.target, structure.leaf.excess, structure.leaf.offset, self.ramp, self.steps,
        )  # fmt: skip
        found = []
        for i, gain, shoot in zip(nodes, gains.tolist(), best, strict=True):
            if gain > self.cost:
                data = (float(i), *(shoot * self.scale).tolist())
                found.append(self._trial("add-leaf", i, data, shoot[None], gain - self.cost))
        return found

    def chain(self, rewrite: Rewrite) -> list[Trial]:
        """A chain of nodes to a place, if it pays."""
        i = int(rewrite.data[0])
        table = np.array([(0.0, 0.0, 0.0), *shoots(rewrite)]) / self.scale
        gain = self._fitted(table, self.pose[i], self.most) - self.cost * (len(table) - 1)
        return [self._trial(rewrite.rule, i, rewrite.data, table[1:], gain)] if gain > 0 else []

    def split(self, rewrite: Rewrite) -> list[Trial]:
        """A node on a branch, if it pays: a new leaf that may slide along the branch."""
        i = int(rewrite.data[0])
        before = self.pose[self.program.structure.parents[i]].copy()
        before[2] = self.pose[i, 2]
        length = float(np.hypot(*(self.pose[i, :2] - before[:2])))
        size = self.most[2] if self.program.structure.limits.sized else self.size / self.scale[2]
        table = np.array([(0.0, 0.0, 0.0), (length / 2, 0.0, size)])
        gain = self._fitted(table, before, np.array([length, 0.0, self.most[2]])) - self.cost
        if gain <= 0 or length == 0.0:
            return []
        trial = self._trial("split", i, rewrite.data, table[1:], gain, before)
        fit = np.array([table[1, 0] / length, table[1, 2] * self.scale[2]])
        return [Trial(replace(trial.rewrite, fit=fit), trial.gain)]

    def removal(self, rewrite: Rewrite) -> list[Trial]:
        """A node whose leaf is worth less than a node costs."""
        gain = self.cost - float(self.loss[int(rewrite.data[0])])
        return [Trial(rewrite, gain / self.target.size)] if gain > 0 else []

    def _fitted(self, table: Floats, pose: Floats, most: Floats) -> float:
        structure = self.program.structure
        return float(
            fit_chain(
                table, pose, most, structure.limits.sized, self.covered, self.target,
                structure.leaf.excess, structure.leaf.offset, self.ramp, self.steps,
            )
        )  # fmt: skip

    def _trial(
        self, rule: str, node: int, data: tuple[float, ...], found: Floats, gain: float, before: Floats | None = None
    ) -> Trial:
        """A trial whose sites are its node and the squares of the canvas (negative numbers) where its leaves lie."""
        start = self.pose[node] if before is None else before
        table = np.concatenate([np.zeros((1, 3)), found])
        there = poses(np.arange(len(table)) - 1, table, start[0], start[1], start[2])[1:]
        middle = self.program.structure.leaf.offset * there[:, 3]
        x = ((there[:, 0] + middle * np.cos(there[:, 2])) // TILE).astype(int)
        y = ((there[:, 1] + middle * np.sin(there[:, 2])) // TILE).astype(int)
        squares = (-1 - (x % 4096) - 4096 * (y % 4096)).tolist()
        fit = (found * self.scale).ravel()
        return Trial(Rewrite(rule, frozenset((node, *squares)), data, fit), gain / self.target.size)
