"""The course of a fit as frames, and as an animated GIF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from d4cad.descent import Record
from d4cad.errors import ExportError, InputError
from d4cad.files import check_writable, replacing
from d4cad.program import Floats

if TYPE_CHECKING:
    from PIL.Image import Image

    from d4cad.fit import Fit

SIDE = 320
"""Pixels along the longer side of a frame."""
FOOT = 16
"""Pixels below it for its caption."""
MOST = 240
"""Frames of an animation; of more, so many are taken evenly."""
PACE, REST = 60, 1200
"""Milliseconds that a frame is shown, and one that ends a search."""
LEVELS = 8
"""Levels of coverage and of the target in a frame: its palette holds every pair of them."""
GROUND, WANTED, EXCESS, SHAPE, INK = (255, 255, 255), (196, 208, 224), (217, 98, 43), (31, 58, 95), (28, 39, 51)
"""Colours of a frame: neither, the target alone, the shape alone, both, and the caption's."""

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One moment: coverage of the program and the target, both (height, width) in 0 to 255 with row 0 at the top; a
    line of text; whether a search ends here."""

    coverage: Bytes
    target: Bytes
    caption: str
    last: bool = False


@dataclass(slots=True, eq=False)
class Film:
    """Collects the frames of one search after another."""

    frames: list[Frame] = field(default_factory=list)
    taken: list[tuple[Record | None, Bytes]] = field(default_factory=list)

    def follow(self, record: Record | None, coverage: Floats) -> None:
        """What :func:`d4cad.fitting.fit_coverage` calls with every round: of coverage (height, width), row 0 lowest."""
        self.taken.append((record, _small(coverage)))

    def end(self, fit: Fit) -> None:
        """What the search has found, with the target that was behind all its frames."""
        title = Path(str(fit.settings.get("picture", "picture"))).stem
        counted = f"{fit.counted or 'primitive'}s"
        target = _small(fit.coverage if fit.target is None else fit.target)
        for record, coverage in self.taken:
            done = "start" if record is None else f"{record.psnr:.1f} dB  {record.primitives} {counted}"
            self.frames.append(Frame(coverage, target, f"{title}  {done}"))
        caption = f"{title}  {fit.psnr:.1f} dB  {fit.primitives} {counted}"
        self.frames.append(Frame(_small(fit.coverage), target, caption, last=True))
        self.taken.clear()


def check(path: Path) -> None:
    """Raises ExportError, before a long fit, for an animation that could not be written."""
    if path.suffix.lower() != ".gif":
        raise ExportError(f"cannot write {path}: an animation is .gif, got {path.suffix or 'no extension'}")
    check_writable(path)


def write_gif(path: Path, frames: Sequence[Frame]) -> None:
    """Write frames as an animation that repeats. Raises InputError for none, ExportError where it cannot be written."""
    check(path)
    if not frames:
        raise InputError("an animation needs at least one frame")
    kept = thinned(frames)
    images = [picture(frame) for frame in kept]
    with replacing(path) as temporary:
        images[0].save(
            temporary,
            save_all=True,
            append_images=images[1:],
            duration=[REST if frame.last else PACE for frame in kept],
            loop=0,
            optimize=False,
        )


def thinned(frames: Sequence[Frame]) -> list[Frame]:
    """At most about MOST frames, evenly, those that end a search among them."""
    step = -(-len(frames) // MOST)
    return [frame for k, frame in enumerate(frames) if k % step == 0 or frame.last]


def picture(frame: Frame) -> Image:
    """The frame drawn: shape on target, a caption below; a palette image of SIDE pixels along its longer side."""
    from PIL import Image, ImageDraw, ImageFont

    height, width = frame.target.shape
    scale = SIDE / max(height, width)
    size = max(round(width * scale), 1), max(round(height * scale), 1)
    shape, wanted = (
        np.asarray(Image.fromarray(part).resize(size, Image.Resampling.BILINEAR)).astype(np.int64)
        for part in (frame.coverage, frame.target)
    )
    code = LEVELS * _level(shape) + _level(wanted)
    code = np.pad(code, ((0, FOOT), (0, 0)))
    image = Image.fromarray(code.astype(np.uint8))
    image.putpalette(_palette())
    caption = frame.caption.encode("ascii", "replace").decode("ascii")
    ImageDraw.Draw(image).text((4, size[1] + 2), caption, fill=LEVELS**2, font=ImageFont.load_default())
    return image


@cache
def _palette() -> list[int]:
    """Mixtures of the four colours for every pair of levels, then the ink."""
    part = np.arange(LEVELS) / (LEVELS - 1)
    c, t = (side[..., None] for side in np.meshgrid(part, part, indexing="ij"))
    ground, wanted, excess, shape = (np.array(color) for color in (GROUND, WANTED, EXCESS, SHAPE))
    mixed: Any = (1 - c) * (1 - t) * ground + (1 - c) * t * wanted + c * (1 - t) * excess + c * t * shape
    return [*np.round(mixed).astype(int).ravel().tolist(), *INK]


def _level(values: Any) -> Any:
    return (values * (LEVELS - 1) + 127) // 255


def _small(coverage: Floats) -> Bytes:
    """Coverage with row 0 lowest as bytes with row 0 at the top, of at most SIDE pixels along a side."""
    from PIL import Image

    image = Image.fromarray(np.round(255 * np.clip(coverage[::-1], 0, 1)).astype(np.uint8))
    image.thumbnail((SIDE, SIDE), Image.Resampling.BOX)
    return np.asarray(image)
