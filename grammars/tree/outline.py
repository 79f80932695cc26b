"""From leaves and branches to an exact sketch."""

from __future__ import annotations

from math import atan2, cos, hypot, sin, tan
from typing import TYPE_CHECKING

from d4cad.errors import GeometryError
from d4cad.grammars.tree.leaves import Leaf
from d4cad.program import Floats

if TYPE_CHECKING:
    from d4cad.sketch import Loop, Sketch

LEAST = 1e-3
"""World units, a twelfth of a pixel of the paper's canvas, under which a leaf is a bare node and no material."""
PINHOLE = 1.4e-4
"""World area, that of a pixel of the paper's canvas, under which a gap between leaves is filled and what stands alone
is dropped."""
POINT = 1e-9
"""World units under which a branch has no direction."""


def leaf_loop(pose: Floats, leaf: Leaf) -> Loop:
    """The outline of a leaf of pose (4,), counter-clockwise: two arcs that meet in the tip, and half a circle."""
    from d4cad.sketch import Loop

    x, y, heading, r = (float(v) for v in pose)
    fx, fy = r * cos(heading), r * sin(heading)
    x, y = x + leaf.offset * fx, y + leaf.offset * fy
    side = tan(atan2(leaf.reach, leaf.excess) / 4)
    points = ((x + fy, y - fx), (x + leaf.reach * fx, y + leaf.reach * fy), (x - fy, y + fx))
    return Loop(points, (side, side, 1.0))


def branch_loop(a: Floats, b: Floats, width: float) -> Loop:
    """The outline of a branch with round ends between two poses, counter-clockwise."""
    from d4cad.sketch import Loop

    dx, dy = float(b[0] - a[0]), float(b[1] - a[1])
    length = hypot(dx, dy)
    ux, uy = (dx / length, dy / length) if length > POINT else (1.0, 0.0)
    h = width / 2
    ax, ay, bx, by = float(a[0]), float(a[1]), float(b[0]), float(b[1])
    right, left = (h * uy, -h * ux), (-h * uy, h * ux)
    if length <= POINT:
        return Loop(((ax + h, ay), (ax - h, ay)), (1.0, 1.0))
    points = (
        (ax + right[0], ay + right[1]),
        (bx + right[0], by + right[1]),
        (bx + left[0], by + left[1]),
        (ax + left[0], ay + left[1]),
    )
    return Loop(points, (0.0, 1.0, 0.0, 1.0))


def joining(parents: tuple[int, ...], pose: Floats) -> list[int]:
    """The nodes whose branches lie between two leaves: neither a stalk below the first one nor a bare twig."""
    leaves = [int(one[3] > LEAST) for one in pose]
    above = list(leaves)
    for node in range(len(parents) - 1, 0, -1):
        above[parents[node]] += above[node]
    return [node for node in range(1, len(parents)) if 0 < above[node] < sum(leaves)]


def union(parents: tuple[int, ...], pose: Floats, leaf: Leaf, branches: float) -> Sketch:
    """The union of all leaves, and, if the width ``branches`` is not 0, of the branches that join them, exactly but for
    holes and specks under a PINHOLE.

    pose: (n, 4) in world units. Raises GeometryError where nothing is left.
    """
    from d4cad.arrangement import regions
    from d4cad.sketch import Sketch

    loops = [leaf_loop(one, leaf) for one in pose if one[3] > LEAST]
    if branches > 0:
        loops += [branch_loop(pose[parents[node]], pose[node], branches) for node in joining(parents, pose)]
    bounding = [loop for loop in regions(loops) if abs(loop.area) > PINHOLE]
    if not bounding:
        raise GeometryError("a tree without leaves bounds no region")
    return Sketch.from_loops(bounding, "world")
