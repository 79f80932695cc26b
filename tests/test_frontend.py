"""Pictures made ready, finished outlines, large and coloured and broken pictures."""

from __future__ import annotations

import warnings
from io import BytesIO
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from d4cad.bench import coverage
from d4cad.canvas import Canvas
from d4cad.cli import app
from d4cad.descent import Stop
from d4cad.errors import D4cadError, InputError
from d4cad.fidelity import left_by
from d4cad.finishing import Finish, finished
from d4cad.fit import Fit
from d4cad.fitting import fit_coverage, fit_image
from d4cad.images import load
from d4cad.layers import fit_layers, layers, oklab, together
from d4cad.placement import Placement
from d4cad.preprocess import despeckled, evened, is_restless, require_threshold
from d4cad.pyramid import fit_pyramid, shrunk
from d4cad.sketch import Circle, Loop, Sketch

N = 128


def drawn(sketch: Sketch, n: int = N) -> np.ndarray:
    """A sketch in pixels of an n x n picture, as its coverage, row 0 lowest."""
    canvas = Canvas.square(n, 0.5)
    middle = n / 2
    return coverage(sketch.translated(-middle, -middle).scaled(canvas.pixel, "world"), canvas)


def box(x0: float, y0: float, x1: float, y1: float) -> Loop:
    return Loop.polyline([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def rounded(x0: float, y0: float, x1: float, y1: float, r: float) -> Loop:
    """A rectangle with fillets."""
    b = np.tan(np.pi / 8)
    turn = [(x0 + r, y0), (x1 - r, y0), (x1, y0 + r), (x1, y1 - r)]
    points = [*turn, (x1 - r, y1), (x0 + r, y1), (x0, y1 - r), (x0, y0 + r)]

    return Loop(tuple(points), (0.0, b) * 4)


PLATE = Sketch.from_loops([rounded(24, 34, 104, 94, 10), Circle((64, 64), 12).loop()])


@pytest.fixture(scope="module")
def plate() -> Fit:
    canvas = Canvas.square(N, 0.5)
    return fit_coverage(drawn(PLATE), canvas)


def test_thresholds_are_read() -> None:
    assert require_threshold(None) == "auto"
    assert [require_threshold(x) for x in ("otsu", "adaptive", "0.25", 1)] == ["otsu", "adaptive", 0.25, 1.0]
    for bad in ("sauvola", "2", -0.1, "nan"):
        with pytest.raises(InputError, match="expected a threshold"):
            require_threshold(bad)


def test_otsu_is_binary() -> None:
    target = load(1 - 0.8 * drawn(PLATE)[::-1], threshold="otsu").target
    assert set(np.unique(target)) == {0.0, 1.0}
    assert np.mean(target != (drawn(PLATE) > 0.5)) < 0.01


def test_uneven_light_is_evened_out() -> None:
    shape = drawn(PLATE)
    rows, columns = np.mgrid[0:N, 0:N] / N
    light = (0.25 + 0.75 * columns) * (0.7 + 0.3 * rows)
    photo = light * (1 - 0.75 * shape) + np.random.default_rng(1).normal(0, 0.01, shape.shape)
    assert np.mean((photo < np.median(photo)) != (shape > 0.5)) > 0.1  # one level cannot part them
    dark = evened(np.clip(photo, 0, 1)) < 0.5
    assert np.mean(dark != (shape > 0.5)) < 0.003
    target = load(np.clip(photo, 0, 1)[::-1], threshold="adaptive").target
    assert np.mean(np.abs(target - shape)) < 0.03
    assert len(np.unique(target)) > 100


def test_specks_and_pinholes_go_and_the_rest_stays() -> None:
    shape = drawn(PLATE)
    dirty = shape.copy()
    dirty[10:12, 10:12] = 1.0
    dirty[12, 10] = 0.4  # its antialiased rim
    dirty[45, 45] = 0.0
    np.testing.assert_array_equal(despeckled(dirty, 6), shape)
    np.testing.assert_array_equal(despeckled(dirty, 0), dirty)
    assert despeckled(dirty, 2)[10, 10] == 1.0
    assert not despeckled(shape, 10**6).any()
    with pytest.raises(InputError, match="only smaller specks"):
        load(1 - shape[::-1], despeckle=N * N)
    with pytest.raises(InputError, match="0 or more pixels, got -1"):
        load(shape, despeckle=-1)


def test_smoothing_drops_noise() -> None:
    noisy = np.clip(1 - 0.8 * drawn(PLATE) + np.random.default_rng(2).normal(0, 0.1, (N, N)), 0, 1)
    rough, calm = load(noisy, smooth=0.0), load(noisy, smooth=1.5)
    inside = np.index_exp[60:66, 28:40]
    assert calm.target[inside].std() < 0.5 * rough.target[inside].std()
    assert calm.noise == pytest.approx(rough.noise, rel=0.2)  # neighbours share what is left of it
    with pytest.raises(InputError, match="smoothing"):
        load(noisy, smooth=float("inf"))


def test_tolerance_is_kept_and_measured(plate: Fit) -> None:
    assert plate.primitives == 10
    assert finished(plate, Finish()) is plate
    found = finished(plate, Finish(tolerance="4.5px"))
    assert found.primitives < 10
    assert plate.target is not None
    assert left_by(found.coverage, plate.target) <= 4.5
    assert "leaves the picture's edge by at most" in found.settings["notes"][-1]
    same = finished(plate, Finish(tolerance=0.01), Placement(scale=1.0))
    assert same.primitives == 10
    np.testing.assert_allclose(found.outline.area, plate.outline.area, rtol=0.03)


def test_lines_only_and_arcs_only(plate: Fit) -> None:
    lines = finished(plate, Finish(lines_only=True))
    assert all(bulge == 0 for loop in lines.outline.loops for bulge in loop.bulges)
    assert plate.target is not None
    assert left_by(lines.coverage, plate.target) < 0.35
    coarse = finished(plate, Finish(lines_only=True, tolerance="2px"))
    assert coarse.primitives < lines.primitives
    arcs = finished(plate, Finish(arcs_only=True))
    assert all(bulge != 0 for loop in arcs.outline.loops for bulge in loop.bulges)
    assert arcs.primitives == 10
    assert left_by(arcs.coverage, plate.target) < 0.1
    with pytest.raises(InputError, match="got both"):
        Finish(lines_only=True, arcs_only=True)


def test_small_radii_become_corners(plate: Fit) -> None:
    sharp = finished(plate, Finish(min_radius="11px"))
    outer = max(sharp.outline.loops, key=lambda loop: loop.area)
    assert len(outer.points) == 4
    assert set(outer.bulges) == {0.0}
    xmin, ymin, xmax, ymax = np.array(sharp.outline.bounds) / sharp.canvas.pixel
    assert (xmax - xmin, ymax - ymin) == pytest.approx((80, 60), abs=0.1)
    kept = finished(plate, Finish(min_radius="9px"))
    assert kept.primitives == 10
    assert "kept 1 circle" in finished(plate, Finish(min_radius="13px")).settings["notes"][1]


def test_small_features_go(plate: Fit) -> None:
    assert finished(plate, Finish(min_feature="25px")).primitives == 8
    assert finished(plate, Finish(min_feature="23px")).primitives == 10
    with pytest.raises(InputError, match="nothing of the part"):
        finished(plate, Finish(min_feature="90px"))
    with pytest.raises(InputError, match="the min feature must be a positive length"):
        Finish(min_feature="-1px")


def test_large_pictures_by_a_coarse_one(plate: Fit) -> None:
    n = 4 * N
    big = drawn(Sketch.from_loops([loop.scaled(4.0) for loop in PLATE.loops]), n)
    # Not a multiple of the step: the coarse picture gets a strip of ground.
    big = big[2:, : n - 3]
    canvas = Canvas.for_image(big.shape, 0.5)
    found = fit_pyramid(big, canvas, coarse=N)
    assert found.settings["coarse"] == 4
    assert found.primitives == 10
    assert found.psnr > 70
    whole = fit_coverage(big, canvas)
    np.testing.assert_allclose(found.outline.area, whole.outline.area, rtol=1e-4)
    assert found.history[-1].seconds >= found.history[0].seconds
    small = fit_pyramid(drawn(PLATE), Canvas.square(N, 0.5))
    assert "coarse" not in small.settings
    np.testing.assert_allclose(shrunk(np.ones((5, 7)), 2), [[1, 1, 1, 0.5], [1, 1, 1, 0.5], [0.5, 0.5, 0.5, 0.25]])


def test_nesting_five_levels_deep() -> None:
    nested = Sketch.from_loops([box(k, k, 160 - k, 160 - k) for k in (10, 25, 40, 55, 70)])
    picture = np.round(255 * (1 - drawn(nested, 160)[::-1])).astype(np.uint8)
    fit = fit_image(picture)
    assert [len(face.holes) for face in fit.outline.faces] == [1, 1, 0]
    assert fit.primitives == 20
    assert fit.psnr > 60


def colored() -> np.ndarray:
    """A blue plate with a yellow disc in it and a red bar beside the disc, on white; antialiased."""
    picture = np.ones((N, N, 3))
    for sketch, color in (
        (Sketch.from_loops([box(16, 24, 112, 104)]), (0.1, 0.3, 0.8)),
        (Sketch.from_loops([Circle((50, 64), 24).loop()]), (0.95, 0.8, 0.1)),
        (Sketch.from_loops([box(84, 40, 100, 90)]), (0.8, 0.1, 0.15)),
    ):
        cover = drawn(sketch)[::-1, :, None]
        picture = picture * (1 - cover) + cover * np.array(color)
    return np.round(255 * picture).astype(np.uint8)


def test_colors_become_layers() -> None:
    found = layers(colored(), 3)
    assert [layer.color for layer in found] == ["#1a4ccc", "#f2cc1a", "#cc1a26"]
    total = sum(layer.target for layer in found)
    assert np.abs(np.max(total) - 1) < 0.02
    disc = drawn(Sketch.from_loops([Circle((50, 64), 24).loop()]))
    assert np.abs(found[1].target - disc).max() < 0.02
    assert len(layers(colored(), 2)) == 2
    with pytest.raises(InputError, match="1 to 16 layers"):
        layers(colored(), 0)
    with pytest.raises(InputError, match="several colours"):
        layers(np.full((N, N, 3), 200, np.uint8), 2)


@pytest.mark.parametrize("noise", [0.0, 15.0])
def test_a_small_area_has_its_own_colour(noise: float) -> None:
    """A tenth of the red plate is blue: as many layers as colours, though median cut splits white and red first."""
    picture = np.full((200, 200, 3), 255.0)
    picture[20:180, 20:180] = (200, 30, 40)
    picture[40:90, 60:110] = (30, 60, 200)
    picture += np.random.default_rng(0).normal(0, noise, picture.shape) if noise else 0
    found = layers(np.clip(np.round(picture), 0, 255).astype(np.uint8), 2)
    assert [int(np.count_nonzero(layer.target > 0.5)) for layer in found] == pytest.approx([23100, 2500], rel=0.01)


def test_oklab() -> None:
    """Values of https://bottosson.github.io/posts/oklab/ for white, and of the CSS Color 4 tests for red."""
    np.testing.assert_allclose(oklab(np.ones(3)), [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(oklab(np.array([1.0, 0, 0])), [0.62796, 0.22486, 0.12585], atol=1e-4)


def test_layers_lie_where_they_were() -> None:
    fits = [fit for _, fit in fit_layers(colored(), 3)]
    common = together(fits, Placement(width=96.0))
    blue, yellow, red = (common.place(fit.outline, fit.canvas) for fit in fits)
    np.testing.assert_allclose(blue.bounds, (0, 0, 96, 80), atol=0.05)
    np.testing.assert_allclose(yellow.bounds, (10, 16, 58, 64), atol=0.05)
    np.testing.assert_allclose(red.bounds, (68, 16, 84, 66), atol=0.05)
    assert len(blue.faces[0].holes) == 2


def test_layers_on_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Image.fromarray(colored()).save("c.png")
    files = [word for name in ("c.svg", "c.dxf", "c.stl") for word in ("-o", name)]
    done = CliRunner().invoke(app, ["fit", "c.png", "--layers", "3", *files, "--scale", "1"])
    assert done.exit_code == 0, done.output
    assert sorted(p.name for p in tmp_path.iterdir()) == ["c-1.stl", "c-2.stl", "c-3.stl", "c.dxf", "c.png", "c.svg"]
    assert Path("c.svg").read_text().count("<g id=") == 3
    space = ezdxf.readfile("c.dxf")
    assert {e.dxf.layer for e in space.modelspace()} == {"LAYER_1", "LAYER_2", "LAYER_3"}
    assert space.layers.get("LAYER_3").rgb == (204, 26, 38)
    assert "note" not in done.stdout
    more = CliRunner().invoke(app, ["fit", "c.png", "--layers", "5", "--scale", "1"])
    assert "5 layers were asked for, but only 3 found" in more.stdout
    refused = CliRunner().invoke(app, ["fit", "c.png", "--layers", "2", "--threshold", "0.5"])
    assert refused.exit_code == 2
    assert "leave one out" in refused.stderr


def encoded(image: Image.Image, kind: str, **options: object) -> bytes:
    stream = BytesIO()
    image.save(stream, kind, **options)
    return stream.getvalue()


def test_modes_and_frames(tmp_path: Path) -> None:
    shape = 1 - drawn(PLATE)[::-1]
    eight = Image.fromarray(np.round(255 * shape).astype(np.uint8))
    wide = Image.fromarray(np.round(65535 * shape).astype(np.uint16))
    blank = Image.new("L", eight.size, 255)
    files = {
        "wide.png": encoded(wide, "PNG"),
        "cmyk.jpg": encoded(eight.convert("CMYK"), "JPEG", quality=95),
        "cmyk.tif": encoded(eight.convert("CMYK"), "TIFF"),
        "palette.png": encoded(eight.convert("P"), "PNG"),
        "one.gif": encoded(eight, "GIF"),
        "moving.gif": encoded(eight, "GIF", save_all=True, append_images=[blank]),
        "moving.webp": encoded(eight, "WEBP", save_all=True, append_images=[blank], lossless=True),
        "moving.png": encoded(eight, "PNG", save_all=True, append_images=[blank]),
        "pages.tif": encoded(eight, "TIFF", save_all=True, append_images=[blank]),
    }
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
        picture = load(tmp_path / name)
        assert np.abs(picture.target - drawn(PLATE)).max() < 0.12, name
        several = name.split(".")[0] in ("moving", "pages")
        assert picture.notes == ((f"{name} has 2 frames or pages: the first is used",) if several else ())
    (note,) = fit_image(tmp_path / "moving.gif").settings["notes"]
    assert note == "moving.gif has 2 frames or pages: the first is used"


def test_pure_noise_ends_and_says_so() -> None:
    noise = np.random.default_rng(3).integers(0, 256, (64, 64)).astype(np.uint8)
    assert is_restless(noise / 255.0)
    assert not is_restless(drawn(PLATE))
    fit = fit_image(noise, max_time=0.01)
    assert fit.stop is Stop.TIME
    assert fit.settings["init"] == "axiom"  # thousands of contours would be one dense step of gigabytes
    assert any("is it noise" in note for note in fit.settings["notes"])


def test_two_hundred_broken_files_give_a_picture_or_a_sentence(tmp_path: Path) -> None:
    """Cut short, bits flipped, stretches overwritten or doubled: a picture may survive that, a traceback may not."""
    rng = np.random.default_rng(4)
    image = Image.fromarray(np.round(255 * (1 - drawn(PLATE)[::-1])).astype(np.uint8)).resize((40, 40))
    kinds = [("PNG", {}), ("JPEG", {}), ("BMP", {}), ("TIFF", {"compression": "tiff_lzw"}), ("WEBP", {}), ("GIF", {})]
    whole = [encoded(image, kind, **options) for kind, options in kinds]
    sentences: list[str] = []
    for k in range(200):
        data = bytearray(whole[k % len(whole)])
        way = int(rng.integers(4))
        at = int(rng.integers(len(data)))
        if way == 0:
            del data[at:]
        elif way == 1:
            for i in rng.integers(0, len(data), 12).tolist():
                data[i] ^= 1 << int(rng.integers(8))
        elif way == 2:
            data[at : at + 30] = rng.bytes(30)
        else:
            data[at:at] = data[at : at + 200]
        path = tmp_path / f"{k}.png"
        path.write_bytes(bytes(data))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                assert np.isfinite(load(path, max_pixels=10**6).target).all()
            except D4cadError as error:
                sentences.append(str(error))
    assert 40 < len(sentences) < 200
    assert all(text.startswith("expected") and "\n" not in text for text in sentences)
