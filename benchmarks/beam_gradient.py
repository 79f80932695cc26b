"""The gradient of compliance against central differences of the solid part on a finer grid.

    python benchmarks/beam_gradient.py [--size 120 60] [--refinement 4] [--member 7]

A truss of chords and diagonals whose edges run at many angles. Each edge is moved parallel to itself by half an element
outwards and inwards, its ends along its neighbours, and the part is analysed on elements ``refinement`` times as small
that are solid or empty by their centres. Compared with it: the derivative of the soft objective, as the search uses it.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

from d4cad.beams.occupancy import solid_elements
from d4cad.beams.problem import Load, Place, Problem, Support
from d4cad.grammars.arc_line import ArcLine
from d4cad.grammars.arc_line.structure import Structure
from d4cad.objectives.compliance import ComplianceLoss
from d4cad.objectives.domain import Domain
from d4cad.objectives.solid import solve_solid
from d4cad.program import Floats, Program

EDGES = (0, 2, *range(4, 13))
"""Edges of the truss; the outer loop's left and right side lie outside of the domain."""


def frame(width: float, height: float) -> Problem:
    """A cantilever loaded below its middle: not its own mirror image, so that a program draws all of it."""
    low = round(0.4 * height) - 2.0
    return Problem(
        "frame", (width, height), 1.0, 0.4,
        supports=(Support(Place((0, 0), (0, height))),),
        loads=(Load(Place((width, low), (width, low + 4)), (0, -1.0)),),
    )  # fmt: skip


def inset(corners: list[tuple[float, float]], by: float) -> list[complex]:
    """A counter-clockwise polygon with its sides moved in."""
    z = np.array([complex(*corner) for corner in corners])
    along = np.roll(z, -1) - z
    along /= np.abs(along)
    before = np.roll(along, 1)
    start, end = z + 1j * before * by, z + 1j * along * by
    reach = ((end - start) * np.conj(along)).imag / (before * np.conj(along)).imag
    return list(start + before * reach)


def truss(domain: Domain, member: float = 7.0) -> Program[Structure]:
    """Chords and diagonals ``member`` elements wide, every edge an arc of bulge 0: as in the search."""
    height, width = domain.shape
    low, high = 2 + member / 2, height - 2 - member / 2
    middle, quarter = width / 2, width / 4
    triangles = [
        [(0.0, low), (middle, low), (quarter, high)],
        [(quarter, high), (middle, low), (3 * quarter, high)],
        [(middle, low), (float(width), low), (3 * quarter, high)],
    ]
    loops = [[complex(-3, 2), complex(width + 3, 2), complex(width + 3, height - 2), complex(-3, height - 2)]]
    loops += [inset(triangle, member / 2)[::-1] for triangle in triangles]
    z = np.array([corner for loop in loops for corner in loop]) + domain.margin * (1 + 1j)
    points = domain.canvas.to_world(np.stack([z.real, z.imag], axis=1))
    return Program(Structure((4, 3, 3, 3), (True,) * 13), np.concatenate([points.ravel(), np.zeros(13)]))


def parts_of(program: Program[Structure]) -> tuple[Any, Any]:
    """Places (n,) of the vertices as complex numbers, and the layout."""
    n = len(program.structure.arcs)
    xy = program.params[: 2 * n].reshape(n, 2)
    return xy[:, 0] + 1j * xy[:, 1], program.structure.layout


def parallel_motion(program: Program[Structure], edge: int) -> Floats:
    """The direction in which one edge moves to its right by 1, its ends along its neighbours."""
    z, layout = parts_of(program)
    end = layout.nxt[edge]
    out = -1j * (z[end] - z[edge]) / abs(z[end] - z[edge])
    way = np.zeros(program.params.size)
    for vertex, beyond in ((edge, layout.prv[edge]), (end, layout.nxt[end])):
        along = z[vertex] - z[beyond]
        move = along / (along * np.conj(out)).real
        way[2 * vertex], way[2 * vertex + 1] = move.real, move.imag
    return way


def slopes(problem: Problem, refinement: int = 4, member: float = 7.0, edges: Sequence[int] = EDGES) -> Floats:
    """(edges, 2): the objective's derivative by the motion of each edge, and that of the solid part."""
    domain, fine = problem.domain(), problem.domain(refinement)
    loss, grammar = ComplianceLoss.of(domain), ArcLine(domain.canvas.pixel)
    program, pixel = truss(domain, member), domain.canvas.pixel
    x, y = domain.canvas.extent

    def compliance(params: Floats) -> float:
        outline = grammar.outline(program.moved(params)).translated(x, y).scaled(1 / pixel, "mm")
        placed = outline.translated(-domain.margin, -domain.margin)
        solid = solid_elements(placed, fine.elastic.grid, 1 / refinement)
        return solve_solid(fine.elastic, solid).compliance / loss.full

    gradient = loss.evaluate(grammar.rasterize(program, domain.canvas)).gradient
    found = []
    for edge in edges:
        way = parallel_motion(program, edge)
        step = 0.5 * pixel * way
        exact = (compliance(program.params + step) - compliance(program.params - step)) / pixel
        found.append((gradient @ way, exact))
    return np.array(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, nargs=2, default=(120, 60))
    parser.add_argument("--refinement", type=int, default=4)
    parser.add_argument("--member", type=float, default=7.0)
    asked = parser.parse_args()
    found, exact = slopes(frame(*asked.size), asked.refinement, asked.member).T
    errors = np.abs(found / exact - 1)
    print(f"{errors.size} edges: relative error median {np.median(errors):.3f}, largest {errors.max():.3f}")


if __name__ == "__main__":
    main()
