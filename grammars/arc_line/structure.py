"""What only rewriting changes in an Arc-Line program, and how its parameters are laid out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from d4cad.errors import GrammarError
from d4cad.program import Floats, Program


@dataclass(frozen=True)
class Structure:
    """Closed loops of lines and arcs.

    sizes: number of edges of each loop, at least 2. arcs: for every edge, loop after loop, whether it is an arc.
    Edge i runs from vertex i to the next vertex of its loop. smooth: vertices, in order, at which both edges share
    their tangent; one of them is an arc. Parameters of a program: x, y of every vertex in world
    units (2 n), then the bulge tan(sweep / 4) of every arc in order.
    """

    sizes: tuple[int, ...]
    arcs: tuple[bool, ...]
    smooth: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if sum(self.sizes) != len(self.arcs) or any(size < 2 for size in self.sizes):
            raise GrammarError(
                f"loops need at least 2 edges each and one kind per edge, got {len(self.arcs)} kinds for {self.sizes}"
            )

    @cached_property
    def layout(self) -> Layout:
        """Index arrays derived from the structure."""
        n = len(self.arcs)
        smooth = np.array(self.smooth, dtype=np.int64)
        nxt = followers(np.array(self.sizes, dtype=np.int64))
        prv = np.empty_like(nxt)
        prv[nxt] = np.arange(n)
        arc = np.array(self.arcs, dtype=np.bool_)
        bulge = np.where(arc, 2 * n + np.cumsum(arc) - 1, -1).astype(np.int64)
        vertex = np.arange(n, dtype=np.int64)
        columns = np.stack([2 * vertex, 2 * vertex + 1, 2 * nxt, 2 * nxt + 1, bulge], axis=1)
        return Layout(nxt, prv, arc, np.flatnonzero(arc), columns, 2 * n + int(arc.sum()), smooth)


def followers(sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """The vertex after each, (n,), in loops of ``sizes`` stored one after another."""
    ends = np.cumsum(sizes)
    nxt = np.arange(1, int(ends[-1]) + 1, dtype=np.int64)
    nxt[ends - 1] = ends - sizes
    return nxt


class Layout(NamedTuple):
    """Index arrays of a structure of n edges.

    nxt: (n,) int64, the vertex at which each edge ends; prv: (n,) int64, the one before. arc: (n,) bool. arc_edges:
    indices of the arcs. columns: (n, 5) int64, the parameters of an edge: x, y of its start, x, y of its end, its
    bulge (-1: a line). size: number of parameters. smooth: (k,) int64, the smooth vertices.
    """

    nxt: NDArray[np.int64]
    prv: NDArray[np.int64]
    arc: NDArray[np.bool_]
    arc_edges: NDArray[np.int64]
    columns: NDArray[np.int64]
    size: int
    smooth: NDArray[np.int64]


class Shape(NamedTuple):
    """Linked loops, as the kernels take them: vertex i, the edge from it to nxt[i], its bulge and kind.

    x, y, b: (n,) float64. arc: (n,) bool. nxt: (n,) int64. Lengths in whatever unit the caller says.
    """

    x: Floats
    y: Floats
    b: Floats
    arc: NDArray[np.bool_]
    nxt: NDArray[np.int64]


def to_shape(program: Program[Structure], scale: float = 1.0, dx: float = 0.0, dy: float = 0.0) -> Shape:
    """The program's loops with world coordinates times ``scale``, plus (dx, dy)."""
    layout = program.structure.layout
    n = len(layout.nxt)
    params = program.params
    b = np.zeros(n)
    b[layout.arc_edges] = params[2 * n :]
    return Shape(params[0 : 2 * n : 2] * scale + dx, params[1 : 2 * n : 2] * scale + dy, b, layout.arc, layout.nxt)


def from_shape(
    shape: Shape,
    sizes: NDArray[np.int64],
    scale: float = 1.0,
    dx: float = 0.0,
    dy: float = 0.0,
    smooth: tuple[int, ...] = (),
) -> Program[Structure]:
    """The program of loops stored one after another with ``sizes``; the inverse of :func:`to_shape`."""
    n = len(shape.x)
    params = np.empty(2 * n + int(shape.arc.sum()))
    params[0 : 2 * n : 2] = (shape.x - dx) / scale
    params[1 : 2 * n : 2] = (shape.y - dy) / scale
    params[2 * n :] = shape.b[shape.arc]
    return Program(Structure(tuple(sizes.tolist()), tuple(shape.arc.tolist()), smooth), params)


def still_smooth(
    vertex: NDArray[np.int64], edge: NDArray[np.int64], nxt: NDArray[np.int64], smooth: NDArray[np.int64], old: Layout
) -> tuple[int, ...]:
    """The new vertices that continue one of the old ``smooth`` ones between the same two edges.

    vertex, edge: (n,) as for :func:`parameter_origin`; nxt: (n,) the new vertices' followers.
    """
    if smooth.size == 0:
        return ()
    before = np.full(len(nxt), -1)
    before[nxt] = edge
    kept = (vertex >= 0) & np.isin(vertex, smooth) & (edge == vertex) & (before == old.prv[vertex])
    return tuple(np.flatnonzero(kept).tolist())


def parameter_origin(
    vertex: NDArray[np.int64], edge: NDArray[np.int64], arc: NDArray[np.bool_], old: Layout
) -> NDArray[np.int64]:
    """For each new parameter the old one it continues, or -1.

    vertex, edge: (n,) int64, the old vertex whose place and the old edge whose bulge the new ones continue, or -1;
    arc: (n,) bool, the new kinds.
    """
    xy = np.stack([np.where(vertex >= 0, 2 * vertex, -1), np.where(vertex >= 0, 2 * vertex + 1, -1)], axis=1).ravel()
    kept = edge[arc]
    bulge = np.where(kept >= 0, old.columns[np.maximum(kept, 0), 4], -1)
    return np.concatenate([xy, bulge])


def sagitta_metric(program: Program[Structure]) -> Floats:
    """Steps (n,) per unit of gradient that amount to the paper's, which moves an arc's sagitta k and not its bulge 2
    k / c.

    The paper descends on k sqrt(2) (SPEC 2, "Scaling"): dk = -dL/dk / 2, so db = -(2 / c^2) dL/db for the chord c.
    """
    layout = program.structure.layout
    n = len(layout.nxt)
    xy = program.params[: 2 * n].reshape(n, 2)
    chord = xy[layout.nxt[layout.arc_edges]] - xy[layout.arc_edges]
    metric = np.ones(layout.size)
    metric[2 * n :] = 2 / np.maximum((chord * chord).sum(axis=1), 1e-6)
    return metric
