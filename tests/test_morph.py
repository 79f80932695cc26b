"""One program continued through pictures, and the frames of a search."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence
from typer.testing import CliRunner

from d4cad.animation import FOOT, MOST, PACE, REST, SIDE, Film, Frame, picture, thinned, write_gif
from d4cad.canvas import Canvas
from d4cad.cli import app
from d4cad.errors import ExportError, InputError
from d4cad.exporters.strip import strip_svg
from d4cad.fitting import fit_image
from d4cad.morphing import morph
from d4cad.programs import load_program
from d4cad.sketch import Sketch

SIZE = 48


def drawn(path: Path, *boxes: tuple[int, int, int, int], size: int = SIZE) -> Path:
    """A picture of black boxes (left, top, right, bottom) in pixels."""
    image = Image.new("L", (size, size), 255)
    for box in boxes:
        image.paste(0, box)
    image.save(path)
    return path


def count(animation: Image.Image) -> int:
    """Frames of an animation."""
    return sum(1 for _ in ImageSequence.Iterator(animation))


@pytest.fixture
def letters(tmp_path: Path) -> list[Path]:
    """An I, an L and a T of bars, 8 pixels wide."""
    bar, foot, top = (20, 8, 28, 40), (20, 32, 40, 40), (8, 8, 40, 16)
    return [
        drawn(tmp_path / f"{name}.png", *boxes)
        for name, boxes in (("I", (bar,)), ("L", (bar, foot)), ("T", (bar, top)))
    ]


@pytest.mark.parametrize(("grammar", "least"), [("arc-line", 40.0), ("union-rect", 30.0), ("tree", 17.0)])
def test_one_program_goes_through_all_pictures(letters: list[Path], grammar: str, least: float) -> None:
    film = Film()
    fits = list(morph(letters, grammar=grammar, film=film))
    assert [fit.settings["picture"] for fit in fits] == ["I.png", "L.png", "T.png"]
    assert min(fit.psnr for fit in fits) > least
    assert [fit.settings["init"] for fit in fits[1:]] == ["program", "program"]
    assert sum(frame.last for frame in film.frames) == 3
    # each search begins with what the one before has found
    for one, other in pairwise(fits):
        assert other.target is not None
        error = float(np.mean((one.grammar.rasterize(one.program, other.canvas).coverage - other.target) ** 2))
        assert other.start_psnr == pytest.approx(-10 * np.log10(error))


def test_the_command_writes_a_folder(letters: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "frames"
    call = ["morph", *map(str, letters), "-o", str(out), "--json"]
    done = CliRunner().invoke(app, call)
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert [row["picture"] for row in told["pictures"]] == ["I.png", "L.png", "T.png"]
    assert min(row["psnr"] for row in told["pictures"]) > 40
    with Image.open(out / "morph.gif") as animation:
        assert animation.size == (SIDE, SIDE + FOOT)
        assert count(animation) > 3
    frames = sorted(out.glob("frame-*.png"))
    assert len(frames) == told["frames"]
    with Image.open(frames[-1]) as last:
        dark = np.asarray(last.convert("RGB")).sum(axis=2)[:SIDE] < 457
    assert dark.mean() == pytest.approx((32 * 8 + 24 * 8) / SIZE**2, rel=0.03)
    assert load_program(out / "03-T.json").primitives == 8
    names = [text.text for text in ET.parse(out / "strip.svg").iter("{http://www.w3.org/2000/svg}text")]
    assert [str(name)[0] for name in names] == ["I", "L", "T"]
    again = CliRunner().invoke(app, call)
    assert again.exit_code == 2
    assert "is not empty: name another one, or add --force" in again.output
    forced = CliRunner().invoke(app, [*call[:3], *call[4:], "--force", "--no-frames"])
    assert forced.exit_code == 0, forced.output
    assert not list(out.glob("frame-*.png"))
    assert (out / "morph.gif").exists()


def test_pictures_that_cannot_be_morphed(letters: list[Path], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a morph needs two pictures at least, got 1"):
        morph(letters[:1])
    wide = drawn(tmp_path / "wide.png", (8, 8, 56, 56), size=64)
    with pytest.raises(InputError, match=r"have one size, got 48x48 \(I\.png\) and 64x64 \(wide\.png\)"):
        morph([letters[0], wide])
    done = CliRunner().invoke(app, ["morph", str(letters[0]), str(wide), "-o", str(tmp_path / "new")])
    assert done.exit_code == 2
    assert not (tmp_path / "new").exists()
    done = CliRunner().invoke(app, ["morph", *map(str, letters), "-o", str(letters[0])])
    assert done.exit_code == 2
    assert "is a file" in done.output


def test_a_folder_that_cannot_be_made_is_told_before_the_first_fit(
    letters: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("d4cad.morphing.load", lambda *_, **__: pytest.fail("a picture was read"))
    done = CliRunner().invoke(app, ["morph", *map(str, letters), "-o", str(letters[0] / "deep" / "new")])
    assert done.exit_code == 2
    assert "cannot write" in done.output


def test_all_get_the_margin_that_one_needs(letters: list[Path], tmp_path: Path) -> None:
    edge = drawn(tmp_path / "edge.png", (0, 0, 24, 48))
    fits = list(morph([letters[0], edge]))
    assert fits[0].canvas.shape == fits[1].canvas.shape == (SIZE + 16, SIZE + 16)
    assert fits[1].psnr > 40


def test_fit_animates(letters: list[Path], tmp_path: Path) -> None:
    gif, svg = tmp_path / "out.gif", tmp_path / "out.svg"
    call = ["fit", str(letters[1]), "--init", "axiom", "--animate", str(gif), "-o", str(svg)]
    done = CliRunner().invoke(app, call)
    assert done.exit_code == 0, done.output
    assert f"wrote {gif}" in done.output
    with Image.open(gif) as animation:
        animation.seek(count(animation) - 1)
        assert animation.info["duration"] == REST
        assert animation.info["loop"] == 0
    refused = CliRunner().invoke(app, [*call[:-3], str(tmp_path / "out.mp4"), "-o", str(svg)])
    assert refused.exit_code == 2
    assert "an animation is .gif, got .mp4" in refused.output


def test_frames_of_a_large_picture_come_from_both_scales(tmp_path: Path) -> None:
    film = Film()
    image = np.zeros((1200, 1200))
    image[300:900, 200:1000] = 1
    film.end(fit_image(image, follow=film.follow))
    assert {frame.coverage.shape for frame in film.frames} <= {(SIDE, SIDE), (300, 300)}
    assert sum(frame.caption.endswith("start") for frame in film.frames) == 2
    shares = [float(frame.coverage.mean()) / 255 for frame in film.frames]
    assert shares == pytest.approx([600 * 800 / 1200**2] * len(shares), rel=0.02)


def test_a_frame_shows_what_is_missing_and_what_is_too_much() -> None:
    left, low = np.zeros((2, 64, 64), np.uint8)
    left[:, :32] = 255
    low[32:] = 255
    image = picture(Frame(left, low, "caption"))
    assert image.size == (SIDE, SIDE + FOOT)
    colors = image.convert("RGB")
    at = [colors.getpixel(place) for place in ((80, 80), (240, 80), (80, 240), (240, 240))]
    assert at == [(217, 98, 43), (255, 255, 255), (31, 58, 95), (196, 208, 224)]
    foot = np.asarray(colors)[SIDE:]
    assert (foot.sum(axis=2) < 250).any()


def test_long_searches_are_thinned(tmp_path: Path) -> None:
    blank = np.zeros((8, 8), np.uint8)
    frames = [Frame(np.full((8, 8), k % 256, np.uint8), blank, str(k), last=k == 777) for k in range(1000)]
    kept = thinned(frames)
    assert len(kept) <= MOST + 1
    assert any(frame.caption == "777" for frame in kept)
    write_gif(tmp_path / "a.gif", frames[:3])
    write_gif(tmp_path / "b.gif", frames[:3])
    assert (tmp_path / "a.gif").read_bytes() == (tmp_path / "b.gif").read_bytes()
    with Image.open(tmp_path / "a.gif") as animation:
        assert count(animation) == 3
        animation.seek(0)
        assert animation.info["duration"] == PACE
    with pytest.raises(InputError, match="at least one frame"):
        write_gif(tmp_path / "c.gif", [])
    with pytest.raises(ExportError, match=r"an animation is \.gif"):
        write_gif(tmp_path / "c.mp4", frames)


def test_a_strip_needs_an_outline() -> None:
    with pytest.raises(InputError, match="at least one outline"):
        strip_svg([], Canvas.square(8))
    assert "<text" in strip_svg([("é & <b>", Sketch(()))], Canvas.square(8))
    ET.fromstring(strip_svg([("é & <b>", Sketch(()))], Canvas.square(8)))
