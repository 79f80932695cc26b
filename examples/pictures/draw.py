"""Draws the pictures of this folder: a bracket, a gasket, a gear-like profile and a letter.

    python examples/pictures/draw.py [FOLDER]

Each is 512 x 512 pixels of area coverage, made of lines and arcs at the coordinates below, in pixels, y up.
"""

from __future__ import annotations

import sys
from math import acos, asin, atan2, ceil, cos, pi, sin, tan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from d4cad.sketch import Loop, Sketch

SIZE = 512
ROWS = 16  # scan lines per pixel; along them coverage is exact

Point = tuple[float, float]


def rounded(corners: list[tuple[float, float, float]]) -> Loop:
    """A polygon of corners (x, y, radius), each rounded by a tangent arc of that radius; 0 leaves it sharp."""
    points: list[Point] = []
    bulges: list[float] = []
    for i, (x, y, radius) in enumerate(corners):
        (px, py, _), (qx, qy, _) = corners[i - 1], corners[(i + 1) % len(corners)]
        ahead, behind = atan2(qy - y, qx - x), atan2(y - py, x - px)
        turn = (ahead - behind + pi) % (2 * pi) - pi
        cut = radius * abs(tan(turn / 2))
        if radius:
            points += [(x - cut * cos(behind), y - cut * sin(behind)), (x + cut * cos(ahead), y + cut * sin(ahead))]
            bulges += [tan(turn / 4), 0.0]
        else:
            points.append((x, y))
            bulges.append(0.0)
    return Loop(tuple(points), tuple(bulges))


def circle(x: float, y: float, radius: float) -> Loop:
    return Loop(((x + radius, y), (x - radius, y)), (1.0, 1.0))


def slot(x: float, y: float, length: float, radius: float) -> Loop:
    """Two semicircles whose centres are ``length`` apart, side by side."""
    left, right = x - length / 2, x + length / 2
    points = ((left, y - radius), (right, y - radius), (right, y + radius), (left, y + radius))
    return Loop(points, (0.0, 1.0, 0.0, 1.0))


def bracket() -> Sketch:
    """An L-shaped bracket: rounded outside, a large fillet inside, a chamfer, two holes and a slot."""
    corners = [
        (56.0, 60.0, 34.0), (452.0, 60.0, 34.0), (452.0, 168.0, 34.0),
        (188.0, 168.0, 64.0), (188.0, 404.0, 0.0), (136.0, 456.0, 0.0), (56.0, 456.0, 34.0),
    ]  # fmt: skip
    return Sketch.from_loops([rounded(corners), circle(122, 390, 30), circle(122, 126, 30), slot(330, 114, 120, 24)])


def gasket() -> Sketch:
    """A flange gasket: two ears tangent to the body by lines, a wide bore, two bolt holes and four dowel holes."""
    middle, body, ear, reach = SIZE / 2, 150.0, 50.0, 172.0
    steep = acos((body - ear) / reach)  # where the common tangents touch both circles
    right, left = middle + reach, middle - reach
    touch = cos(steep), sin(steep)
    points = (
        (right + ear * touch[0], middle + ear * touch[1]), (middle + body * touch[0], middle + body * touch[1]),
        (middle - body * touch[0], middle + body * touch[1]), (left - ear * touch[0], middle + ear * touch[1]),
        (left - ear * touch[0], middle - ear * touch[1]), (middle - body * touch[0], middle - body * touch[1]),
        (middle + body * touch[0], middle - body * touch[1]), (right + ear * touch[0], middle - ear * touch[1]),
    )  # fmt: skip
    around, end = tan((pi - 2 * steep) / 4), tan(2 * steep / 4)
    outer = Loop(points, (0.0, around, 0.0, end, 0.0, around, 0.0, end))
    bolts = [circle(left, middle, 22), circle(right, middle, 22)]
    dowels = [circle(middle + 125 * cos(a), middle + 125 * sin(a), 9) for a in (0.9, pi - 0.9, pi + 0.9, -0.9)]
    return Sketch.from_loops([outer, circle(middle, middle, 96), *bolts, *dowels])


def gear() -> Sketch:
    """A gear-like profile: twelve straight-flanked teeth with arcs at tip and gullet, and a bore with a keyway."""
    teeth, pitch = 12, pi / 6
    middle = SIZE / 2
    polar: list[Point] = []
    for k in range(teeth):
        polar += [(k * pitch - 0.095, 226.0), (k * pitch + 0.095, 226.0)]
        polar += [(k * pitch + 0.15, 182.0), (k * pitch + pitch - 0.15, 182.0)]
    outer = Loop(
        tuple((middle + r * cos(a), middle + r * sin(a)) for a, r in polar), (tan(0.19 / 4), 0.0, -0.45, 0.0) * teeth
    )
    bore, half = 58.0, 15.0
    mouth = asin(half / bore)
    x = middle + bore * cos(mouth)
    keyed = Loop(
        ((x, middle + half), (x, middle - half), (middle + 82, middle - half), (middle + 82, middle + half)),
        (tan((2 * pi - 2 * mouth) / 4), 0.0, 0.0, 0.0),
    )
    return Sketch.from_loops([outer, keyed])


def letter() -> Sketch:
    """A capital R: a bowl of arcs tangent to the bars, a slanted leg."""
    x, y, radius, low = 272.0, 338.0, 114.0, -1.281
    bowl_start = (x + radius * cos(low), y + radius * sin(low))
    outer = Loop(
        ((110, 60), (190, 60), (190, 206), (220, 206), (306, 60), (404, 60), bowl_start, (x, y + radius), (110, 452)),
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, tan((pi / 2 - low) / 4), 0.0, 0.0),
    )
    counter = Loop(((190, 285), (262, 285), (262, 391), (190, 391)), (0.0, 1.0, 0.0, 0.0))
    return Sketch.from_loops([outer, counter])


def coverage(sketch: Sketch, size: int = SIZE) -> NDArray[np.float64]:
    """Area coverage (size, size) in [0, 1], top row first: exact along x, ``ROWS`` scan lines per pixel along y."""
    y = (np.arange(size * ROWS) + 0.5) / ROWS
    total = np.zeros((size * ROWS, size + 1))
    for side in sketch.polygon(0.002):
        for (x0, y0), (x1, y1) in zip(side, np.roll(side, -1, axis=0), strict=True):
            low, high = (ceil(min(v * ROWS - 0.5, size * ROWS)) for v in sorted((y0, y1)))
            rows = np.arange(max(low, 0), high)
            if rows.size == 0:
                continue
            # Material lies to the left of travel: a falling side begins it for all pixels east of x.
            x = x0 + (x1 - x0) * (y[rows] - y0) / (y1 - y0)
            column = np.clip(np.floor(x).astype(int), 0, size - 1)
            part, sign = x - column, 1.0 if y1 < y0 else -1.0
            total[rows, column] += sign * (1 - part)
            total[rows, column + 1] += sign * part
    inside = np.cumsum(total[:, :size], axis=1)
    return np.asarray(inside.reshape(size, ROWS, size).mean(axis=1)[::-1])


PICTURES = {"bracket": bracket, "gasket": gasket, "gear": gear, "letter": letter}
BLACK_ON_WHITE = {"bracket", "letter"}


def draw(name: str) -> Image.Image:
    """One of PICTURES as an 8-bit grey image."""
    values = coverage(PICTURES[name]())
    values = 1 - values if name in BLACK_ON_WHITE else values
    return Image.fromarray(np.rint(np.clip(values, 0, 1) * 255).astype(np.uint8))


def main(folder: Path = Path(__file__).parent) -> None:
    for name in PICTURES:
        draw(name).save(folder / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
