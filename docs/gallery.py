"""Fits the gallery's pictures and writes docs/gallery.md and docs/images/gallery/: `python docs/gallery.py`.

All pictures are our own: shapes of the seeded generator, and those of examples/pictures.
"""

from __future__ import annotations

import base64
import io
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from d4cad.bench import coverage
from d4cad.canvas import AREA, Canvas
from d4cad.exporters.svg import face_path
from d4cad.fit import Fit
from d4cad.fitting import fit_coverage, fit_image
from d4cad.program import Floats
from d4cad.shapes import generate

DOCS = Path(__file__).parent
PICTURES = DOCS.parent / "examples" / "pictures"
NAMES = {"arc-line": "lines and arcs", "union-rect": "rectangles", "tree": "a tree of leaves"}
SIDE = 200
"""Width and height of each of a card's two panels, in pixels."""


@dataclass(frozen=True, slots=True)
class Piece:
    """One result: what it is, in words, and how it is fitted."""

    title: str
    fit: Callable[[], Fit]


def drawn(seed: int, primitives: int, size: int = 256) -> Floats:
    """Coverage (size, size) of a shape of the generator, as an 8-bit picture has it."""
    canvas = Canvas.square(size, AREA)
    return np.rint(coverage(generate(np.random.default_rng(seed), primitives), canvas) * 255) / 255


def degraded(picture: Floats, noise: float = 0.0, level: float | None = None) -> Floats:
    """The picture with noise of that standard deviation, or in black and white."""
    noisy = picture + noise * np.random.default_rng(0).normal(size=picture.shape)
    return np.clip(noisy, 0, 1) if level is None else (noisy > level).astype(np.float64)


def pieces() -> Iterator[Piece]:
    """At least 24 results, from easy to hard, and in all grammars."""
    for name in ("bracket", "gasket", "gear", "letter"):
        yield Piece(f"{name}.png", lambda name=name: fit_image(PICTURES / f"{name}.png"))
    for seed in (3, 4, 7, 9, 12, 14, 21):
        yield Piece(f"a part of 8 primitives, seed {seed}", lambda seed=seed: fit_image(drawn(seed, 8)))
    for seed in (31, 33, 36, 38):
        yield Piece(f"a part of 40 primitives, seed {seed}", lambda seed=seed: fit_image(drawn(seed, 40)))
    for seed in (51, 52):
        yield Piece(f"a part of 95 primitives, seed {seed}", lambda seed=seed: fit_image(drawn(seed, 95)))
    yield Piece("seed 4 at 64x64 pixels", lambda: fit_image(drawn(4, 8, 64)))
    yield Piece("seed 7 with noise of 0.1", lambda: fit_image(degraded(drawn(7, 8), noise=0.1)))
    yield Piece("seed 12 in black and white", lambda: fit_image(degraded(drawn(12, 8), level=0.5)))
    for seed in (3, 9, 21):
        yield Piece(f"seed {seed} as rectangles", lambda seed=seed: in_grammar(seed, "union-rect"))
    for seed in (4, 12, 14):
        yield Piece(f"seed {seed} as a tree", lambda seed=seed: in_grammar(seed, "tree"))


def in_grammar(seed: int, grammar: str) -> Fit:
    """A shape of the generator in the paper's raster, in another grammar."""
    canvas = Canvas.square(256)
    return fit_coverage(coverage(generate(np.random.default_rng(seed), 8), canvas), canvas, grammar=grammar)


def card(fit: Fit, path: Path) -> None:
    """The picture and, beside it, the exact outline with its vertices, as an SVG file."""
    assert fit.target is not None
    low_x, low_y, side = window(fit.target)
    scale = SIDE / side
    part = np.zeros((side, side))
    x0, y0 = max(low_x, 0), max(low_y, 0)
    seen = fit.target[y0 : low_y + side, x0 : low_x + side]
    part[y0 - low_y : y0 - low_y + seen.shape[0], x0 - low_x : x0 - low_x + seen.shape[1]] = seen
    grey = Image.fromarray(np.rint((1 - part[::-1]) * 255).astype(np.uint8))
    png = io.BytesIO()
    (grey.resize((SIDE, SIDE)) if grey.width > SIDE else grey).save(png, "PNG", optimize=True)
    data = base64.b64encode(png.getvalue()).decode()
    extent_x, extent_y = fit.canvas.extent
    pixel = fit.canvas.pixel
    sketch = fit.outline.translated(extent_x - low_x * pixel, extent_y - low_y * pixel - side * pixel)
    sketch = sketch.scaled(scale / pixel, unit="world")
    faces = "".join(f'<path d="{rounded(face_path(face))}"/>' for face in sketch.faces)
    dots = "".join(
        f'<circle cx="{x:.1f}" cy="{-y:.1f}" r="{1.8 if sketch.primitives < 60 else 1.1}"/>'
        for loop in sketch.loops
        if loop.circle is None
        for x, y in loop.points
    )
    path.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * SIDE + 12} {SIDE}">'
        f'<image href="data:image/png;base64,{data}" width="{SIDE}" height="{SIDE}"/>'
        f'<g transform="translate({SIDE + 12} 0)"><g fill="#dbe4f3" fill-rule="evenodd" stroke="#1f3a5f"'
        f' stroke-width="1.2" stroke-linejoin="round">{faces}</g><g fill="#d9622b">{dots}</g></g></svg>\n',
        encoding="utf-8",
    )


def window(target: Floats) -> tuple[int, int, int]:
    """The square around the shape with a margin: its lowest column and row, which may be outside, and its side, in
    pixels."""
    rows, cols = (np.flatnonzero(np.max(target, axis=axis) > 0.5) for axis in (1, 0))
    side = int(1.12 * max(np.ptp(rows), np.ptp(cols))) + 4
    return int(cols[0] + cols[-1] - side + 1) // 2, int(rows[0] + rows[-1] - side + 1) // 2, side


def rounded(path: str) -> str:
    """Path data with two decimals."""
    return re.sub(r"-?\d+\.\d+(?:e-?\d+)?", lambda match: f"{float(match[0]):.2f}", path)


def caption(piece: Piece, fit: Fit) -> str:
    """What came of it, in one line."""
    what = f"{fit.primitives} {fit.counted}s" if fit.counted else f"{fit.primitives} primitives"
    return f"{piece.title}: {what}, {min(fit.psnr, 120):.0f} dB, {fit.seconds:.2f} CPU s"


def main(folder: Path = DOCS, limit: int | None = None) -> dict[str, Any]:
    """Write the page and its pictures to ``folder``; returns their number and the worst PSNR in dB."""
    images = folder / "images" / "gallery"
    images.mkdir(parents=True, exist_ok=True)
    cards, worst = [], np.inf
    for k, piece in enumerate(list(pieces())[:limit], 1):
        fit = piece.fit()
        card(fit, images / f"{k:02d}.svg")
        text = caption(piece, fit)
        worst = min(worst, fit.psnr)
        cards.append(
            f'<figure><img src="images/gallery/{k:02d}.svg" alt="{text}"><figcaption>{text}</figcaption></figure>'
        )
    page = (
        "# Gallery\n\nEach card: the picture, and the exact outline with its vertices (full circles have none). Made by"
        " `python docs/gallery.py` from our own shapes; dB against the picture as given, seconds on one busy core.\n\n"
        '<div class="gallery" markdown="0">\n' + "\n".join(cards) + "\n</div>\n"
    )
    (folder / "gallery.md").write_text(page, encoding="utf-8")
    return {"results": len(cards), "worst": float(worst)}


if __name__ == "__main__":
    print(main(limit=int(sys.argv[1]) if len(sys.argv) > 1 else None))
