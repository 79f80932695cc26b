"""A sketch as a vector of numbers and back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from d4cad.edges import Floats
from d4cad.errors import GeometryError
from d4cad.relations import Ref
from d4cad.sketch import Loop, Sketch

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Parameters:
    """The layout of a sketch's numbers: x, y of every vertex, loop after loop, then the bulge of every arc in order.

    Edges are numbered through all loops; edge k starts at vertex k.
    """

    sketch: Sketch

    @cached_property
    def sizes(self) -> tuple[int, ...]:
        """Number of edges of each loop."""
        return tuple(len(loop.bulges) for loop in self.sketch.loops)

    @cached_property
    def starts(self) -> tuple[int, ...]:
        """The first edge of each loop, and behind them the number of edges."""
        return tuple(int(k) for k in np.cumsum((0, *self.sizes)))

    @cached_property
    def refs(self) -> tuple[Ref, ...]:
        """Loop and edge of each edge number."""
        return tuple((loop, edge) for loop, size in enumerate(self.sizes) for edge in range(size))

    def number(self, ref: Ref) -> int:
        """The edge number of a reference."""
        return self.starts[ref[0]] + ref[1]

    @cached_property
    def following(self) -> Ints:
        """(E,) the edge after each."""
        after = np.arange(1, self.starts[-1] + 1)
        after[np.array(self.starts[1:], dtype=np.int64) - 1] = self.starts[:-1]
        return after

    @cached_property
    def arcs(self) -> NDArray[np.bool_]:
        """(E,) whether an edge is an arc."""
        return np.array([bulge != 0 for loop in self.sketch.loops for bulge in loop.bulges], dtype=np.bool_)

    @cached_property
    def circles(self) -> NDArray[np.bool_]:
        """(loops,) whether a loop is one full circle of two edges."""
        return np.array([size == 2 and loop.circle is not None for size, loop in self._sized], dtype=np.bool_)

    @property
    def _sized(self) -> list[tuple[int, Loop]]:
        return list(zip(self.sizes, self.sketch.loops, strict=True))

    @cached_property
    def columns(self) -> Ints:
        """(E, 5) the parameters of an edge: x, y of its start, x, y of its end, its bulge (-1: a line)."""
        k = np.arange(self.starts[-1])
        bulge = np.where(self.arcs, 2 * k.size + np.cumsum(self.arcs) - 1, -1)
        return np.stack([2 * k, 2 * k + 1, 2 * self.following, 2 * self.following + 1, bulge], axis=1)

    @cached_property
    def size(self) -> int:
        """Number of parameters."""
        return 2 * self.starts[-1] + int(self.arcs.sum())

    @cached_property
    def values(self) -> Floats:
        """(n,) the sketch's own numbers, a full circle's two vertices at its right and left."""
        loops = [self.sketch.loops[k] if not round_ else _upright(self.sketch.loops[k]) for k, round_ in self._rounds]
        points = [x for loop in loops for point in loop.points for x in point]
        return np.array([*points, *(bulge for loop in loops for bulge in loop.bulges if bulge != 0)], dtype=np.float64)

    @property
    def _rounds(self) -> list[tuple[int, bool]]:
        return list(enumerate(self.circles.tolist()))

    def sketched(self, params: Floats) -> Sketch:
        """The sketch of other numbers (n,): the same faces, without relations.

        Raises GeometryError where the loops cross or touch, change their nesting or their sense.
        """
        points = params[: 2 * self.starts[-1]].reshape(-1, 2)
        bulges = np.zeros(self.starts[-1])
        bulges[self.arcs] = params[2 * self.starts[-1] :]
        ends = list(zip(self.starts[:-1], self.starts[1:], strict=True))
        loops = [Loop.from_arrays(points[a:b], bulges[a:b]) for a, b in ends]
        found = Sketch.from_loops(loops, self.sketch.unit)
        if found.loops != tuple(loops) or [len(f.holes) for f in found.faces] != [
            len(f.holes) for f in self.sketch.faces
        ]:
            raise GeometryError("the loops have changed their nesting")
        return found


def _upright(loop: Loop) -> Loop:
    """The circle from its right vertex; itself if it is so already, to the last bit."""
    (x0, y0), (x1, y1) = loop.points
    if y0 == y1 and x0 > x1 and all(abs(bulge) == 1 for bulge in loop.bulges):
        return loop
    circle = loop.circle
    assert circle is not None
    return circle.loop(clockwise=loop.area < 0)
