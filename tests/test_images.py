"""Pictures of every kind become the same coverage; what is no picture is refused in one sentence."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from d4cad.errors import InputError
from d4cad.images import load

Floats = NDArray[np.float64]

H, W = 48, 64


def disc(height: int = H, width: int = W) -> Floats:
    """An antialiased disc above the middle and a wedge at the lower left, top row first: no symmetry."""
    y, x = np.mgrid[:height, :width] + 0.5
    ball = np.clip(height / 4 + 0.5 - np.hypot(x - width / 2, y - height / 2.5), 0, 1)
    wedge = (x < width / 4) & (y > height * 0.8) & (x > 3) & (y < height - 3)
    return np.asarray(np.maximum(ball, wedge), dtype=np.float64)


def bytes_of(values: Floats) -> NDArray[np.uint8]:
    return np.rint(values * 255).astype(np.uint8)


def grey(values: Floats) -> Image.Image:
    return Image.fromarray(bytes_of(values))


SHAPE = disc()
EIGHT_BIT = bytes_of(SHAPE) / 255


def save(image: Image.Image, path: Path, **options: Any) -> Path:
    image.save(path, **options)
    return path


def assert_shape(target: Floats, tolerance: float = 1e-12) -> None:
    np.testing.assert_allclose(target, EIGHT_BIT[::-1], atol=tolerance)


def test_convention_row_zero_is_lowest(tmp_path: Path) -> None:
    picture = load(save(grey(1 - SHAPE), tmp_path / "a.png"))
    assert picture.target.shape == (H, W)
    assert picture.target.dtype == np.float64
    assert picture.target[5, 6] == 1  # the wedge, at the bottom
    assert picture.target[H - 6, 6] == 0
    assert picture.name == "a.png"


@pytest.mark.parametrize("extension", ["png", "bmp", "tiff", "webp"])
@pytest.mark.parametrize("dark_shape", [True, False])
def test_lossless_formats_of_either_polarity(tmp_path: Path, extension: str, dark_shape: bool) -> None:
    drawn = 1 - SHAPE if dark_shape else SHAPE
    path = tmp_path / f"a.{extension}"
    save(grey(drawn).convert("RGB"), path, **({"lossless": True} if extension == "webp" else {}))
    picture = load(path)
    assert_shape(picture.target)
    assert picture.noise == 0


def test_jpeg_is_near_and_noisy(tmp_path: Path) -> None:
    picture = load(save(grey(1 - SHAPE), tmp_path / "a.JPG", quality=80))
    assert_shape(picture.target, 0.15)
    assert 0 <= picture.noise < 0.05


def test_name_of_the_file_does_not_matter(tmp_path: Path) -> None:
    assert_shape(load(str(save(grey(1 - SHAPE), tmp_path / "a.png").rename(tmp_path / "picture"))).target)


@pytest.mark.parametrize("mode", ["1", "P", "LA", "RGBA", "CMYK", "YCbCr", "I;16", "I", "F"])
def test_modes(tmp_path: Path, mode: str) -> None:
    lossy = {"1": 0.51, "P": 0.02, "YCbCr": 0.01, "CMYK": 0.01}.get(mode, 1e-4)
    drawn = 1 - SHAPE
    if mode in ("I;16", "I"):
        wide = np.rint(drawn * 65535).astype(np.uint16 if mode == "I;16" else np.int32)
        image = Image.fromarray(wide)
        lossy = 2e-3
    elif mode == "F":
        image = Image.fromarray(drawn.astype(np.float32) * 7)
        lossy = 2e-3
    else:
        # Without dithering, and with an adaptive palette, conversion loses little.
        options: dict[str, Any] = {"1": {"dither": 0}, "P": {"palette": 1}}.get(mode, {})
        image = grey(drawn).convert("RGB").convert(mode, **options)
    suffix = "png" if mode in ("1", "P", "LA", "RGBA", "I;16") else "tiff"
    assert_shape(load(save(image, tmp_path / f"a.{suffix}")).target, lossy)


def test_colour(tmp_path: Path) -> None:
    blue, yellow = np.array([20, 40, 160]), np.array([250, 230, 90])
    drawn = yellow + SHAPE[..., None] * (blue - yellow)
    target = load(save(Image.fromarray(np.rint(drawn).astype(np.uint8)), tmp_path / "a.png")).target
    assert_shape(target, 0.01)


@pytest.mark.parametrize("ink", [0, 255])
def test_alpha_decides_where_it_varies(tmp_path: Path, ink: int) -> None:
    pixels = np.full((H, W, 4), ink, np.uint8)
    pixels[..., 3] = bytes_of(SHAPE)
    assert_shape(load(save(Image.fromarray(pixels), tmp_path / "a.png")).target)


def test_what_is_opaque_is_the_shape_even_at_the_border(tmp_path: Path) -> None:
    pixels = np.zeros((H, W, 4), np.uint8)
    pixels[..., 3] = bytes_of(1 - SHAPE)
    np.testing.assert_allclose(load(save(Image.fromarray(pixels), tmp_path / "a.png")).target, 1 - EIGHT_BIT[::-1])


def test_nearly_constant_alpha_is_ignored(tmp_path: Path) -> None:
    pixels = np.repeat(bytes_of(1 - SHAPE)[..., None], 4, axis=2)
    pixels[..., 3] = 250
    pixels[:5, :, 3] = 255
    assert_shape(load(save(Image.fromarray(pixels), tmp_path / "a.png")).target)


def test_transparent_palette_entry(tmp_path: Path) -> None:
    image = grey((SHAPE > 0.5).astype(np.float64)).convert("P")
    path = save(image, tmp_path / "a.png", transparency=image.getpixel((W - 1, 0)))
    np.testing.assert_array_equal(load(path).target, (SHAPE > 0.5)[::-1])


def test_exif_orientation(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6  # the camera lay on its side: turn by 90 degrees clockwise to look at it
    turned = grey(1 - SHAPE).transpose(Image.Transpose.ROTATE_90)
    assert_shape(load(save(turned, tmp_path / "a.png", exif=exif)).target)


def test_resolution(tmp_path: Path) -> None:
    image = grey(1 - SHAPE)
    dpi = load(save(image, tmp_path / "a.png", dpi=(300, 300))).dpi
    assert dpi == pytest.approx(300, abs=0.1)
    assert load(save(image, tmp_path / "b.jpg", dpi=(96, 96))).dpi == 96
    assert load(save(image, tmp_path / "c.png", dpi=(300, 72))).dpi is None
    assert load(save(image, tmp_path / "d.png")).dpi is None


def test_faint_and_shifted_levels_are_normalised() -> None:
    assert_shape(load(0.7 - 0.4 * EIGHT_BIT).target, 1e-12)
    assert_shape(load(0.3 + 0.05 * EIGHT_BIT).target, 1e-12)


def test_noise_is_estimated_and_does_not_move_the_levels() -> None:
    rng = np.random.default_rng(1)
    clean = disc(200, 240)
    noisy = 0.8 - 0.6 * clean + rng.normal(0, 0.03, clean.shape)
    picture = load(noisy)
    assert picture.noise == pytest.approx(0.03 / 0.6, rel=0.1)
    assert abs(np.median(picture.target[::-1][clean == 1]) - 1) < 0.01
    assert abs(np.median(picture.target[::-1][clean == 0])) < 0.01


def test_a_small_shape_on_large_ground() -> None:
    pixels = np.zeros((200, 200))
    pixels[100:104, 100:104] = 1
    np.testing.assert_array_equal(load(pixels).target, pixels[::-1])


def test_invert_and_threshold() -> None:
    np.testing.assert_allclose(load(EIGHT_BIT, invert=True).target, 1 - EIGHT_BIT[::-1])
    np.testing.assert_array_equal(load(EIGHT_BIT, threshold=0.3).target, EIGHT_BIT[::-1] > 0.3)
    np.testing.assert_array_equal(load(1 - EIGHT_BIT, threshold=0.25).target, EIGHT_BIT[::-1] >= 0.75)
    assert load(EIGHT_BIT + 0.0, threshold=0.5).noise == 0


@pytest.mark.parametrize("dtype", ["bool", "uint8", "int64", "uint16", "float32", "float64"])
@pytest.mark.parametrize("channels", [0, 1, 3])
def test_arrays(dtype: str, channels: int) -> None:
    hard = SHAPE > 0.5
    array = hard * {"uint8": 255, "uint16": 65535}.get(dtype, 1)
    if channels:
        array = np.repeat(array[..., None], channels, axis=2)
    picture = load(array.astype(dtype))
    np.testing.assert_allclose(picture.target, hard[::-1], atol=1e-12)
    assert picture.name == "array"


def test_a_shape_that_touches_one_border() -> None:
    pixels = np.zeros((40, 40))
    pixels[:, :12] = 1
    np.testing.assert_array_equal(load(pixels).target, pixels[::-1])


def test_half_of_the_border_is_the_rarer_level() -> None:
    pixels = np.zeros((40, 40))
    pixels[:, :20] = 1
    pixels[10:20, 25:35] = 1
    np.testing.assert_array_equal(load(pixels).target, 1 - pixels[::-1])


def truncated(path: Path) -> Path:
    rng = np.random.default_rng(0)
    Image.fromarray(rng.integers(0, 255, (64, 64), dtype=np.uint8)).save(path)
    path.write_bytes(path.read_bytes()[:-900])
    return path


def header_of_huge_png(path: Path, side: int) -> Path:
    """A PNG whose header promises side x side pixels and which has none: decoding it would fail."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", b"") + chunk(b"IEND", b""))
    return path


def test_missing_directory_and_text(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"there is no file .*nowhere\.png$"):
        load(tmp_path / "nowhere.png")
    with pytest.raises(InputError, match=r"is a directory$"):
        load(tmp_path)
    (tmp_path / "text.png").write_text("not a picture")
    with pytest.raises(InputError, match=r"expected a PNG, .* WebP or GIF picture, but .*text\.png is none"):
        load(tmp_path / "text.png")
    (tmp_path / "empty.png").write_bytes(b"")
    with pytest.raises(InputError, match="is none of these"):
        load(tmp_path / "empty.png")


def test_truncated(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cut.png is damaged or cut short"):
        load(truncated(tmp_path / "cut.png"))
    cut = save(grey(SHAPE), tmp_path / "cut.jpg")
    cut.write_bytes(cut.read_bytes()[:-400])
    with pytest.raises(InputError, match="is damaged or cut short"):
        load(cut)


@pytest.mark.parametrize("extension", ["png", "jpg", "bmp", "tiff", "webp"])
def test_damaged_at_any_byte(tmp_path: Path, extension: str) -> None:
    """Whatever is broken: a picture, or an InputError, and nothing else."""
    whole = save(grey(SHAPE), tmp_path / f"whole.{extension}").read_bytes()
    rng = np.random.default_rng(3)
    path = tmp_path / f"a.{extension}"
    refusals: list[str] = []
    for _ in range(60):
        broken = bytearray(whole)
        for at in rng.integers(0, min(len(whole), 200), 3):
            broken[at] = rng.integers(256)
        path.write_bytes(bytes(broken[: rng.integers(1, len(whole) + 1)]))
        try:
            target = load(path).target
        except InputError as error:
            refusals.append(str(error))
        else:
            assert np.all((target >= 0) & (target <= 1))
    assert refusals
    assert all(path.name in said for said in refusals)


@pytest.mark.parametrize("side", [8_000, 20_000])
def test_too_large_is_refused_before_decoding(tmp_path: Path, side: int) -> None:
    with pytest.raises(InputError, match=r"expected at most 50 million pixels, but huge\.png has"):
        load(header_of_huge_png(tmp_path / "huge.png", side))


def test_own_limit(tmp_path: Path) -> None:
    path = save(grey(SHAPE), tmp_path / "a.png")
    with pytest.raises(InputError, match=r"at most 0\.002 million pixels, but a.png has 64x48"):
        load(path, max_pixels=2000)
    assert load(path, max_pixels=H * W).target.shape == (H, W)


@pytest.mark.parametrize("size", [(1, 1), (7, 100), (100, 7)])
def test_too_small(tmp_path: Path, size: tuple[int, int]) -> None:
    with pytest.raises(InputError, match=f"expected at least 8x8 pixels, but a.png has {size[0]}x{size[1]}"):
        load(save(Image.new("L", size), tmp_path / "a.png"))


@pytest.mark.parametrize("level", [0.0, 0.5, 1.0])
def test_no_contrast(level: float) -> None:
    with pytest.raises(InputError, match="array has no contrast"):
        load(np.full((30, 30), level))


def test_transparent_everywhere() -> None:
    pixels = np.zeros((30, 30, 4))
    pixels[10:20, 10:20, :3] = 1
    with pytest.raises(InputError, match="transparent everywhere"):
        load(pixels)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.where(SHAPE > 0.5, np.nan, 0.0), "expected finite values, but the array has nan at"),
        (np.where(SHAPE > 0.5, np.inf, 0.0), "expected finite values, but the array has inf at"),
        (np.zeros(100), r"expected an array \(height, width\).*got shape \(100,\)"),
        (np.zeros((4, 30, 30, 3)), r"got shape \(4, 30, 30, 3\)"),
        (np.zeros((30, 30, 7)), r"got shape \(30, 30, 7\)"),
        (np.zeros((0, 0)), "expected at least 8x8 pixels, but array has 0x0"),
        (np.zeros((30, 0)), "at least 8x8"),
        (SHAPE * 2.5, "expected array values from 0 to 1"),
        (SHAPE - 0.5, "expected array values from 0 to 1"),
        (np.where(SHAPE > 0.5, 70000, 0), "expected array values from 0 to 1"),
        (SHAPE.astype(complex), "expected an array of bool, integers or floats, got complex128"),
        (np.full((30, 30), "x"), "expected an array of bool"),
    ],
)
def test_arrays_that_are_no_picture(array: NDArray[np.float64], message: str) -> None:
    with pytest.raises(InputError, match=message):
        load(array)


@pytest.mark.parametrize("threshold", [-0.1, 1.5, float("nan")])
def test_threshold_out_of_range(threshold: float) -> None:
    with pytest.raises(InputError, match="threshold between 0 and 1"):
        load(SHAPE, threshold=threshold)


def test_threshold_beside_both_levels() -> None:
    with pytest.raises(
        InputError, match=r"between the levels 0\.30 and 0\.70 of array, but all of it is at or below 0\.9"
    ):
        load(0.3 + 0.4 * (SHAPE > 0.5), threshold=0.9)


def test_not_a_path() -> None:
    with pytest.raises(InputError, match="expected the path of a picture or an array, got int"):
        load(3)  # type: ignore[arg-type]


def test_thin_lines_keep_their_levels(tmp_path: Path) -> None:
    image = Image.new("L", (128, 128), 255)
    ImageDraw.Draw(image).line((10, 12, 118, 100), fill=0, width=3)
    target = load(save(image, tmp_path / "a.png")).target
    assert target.min() == 0
    assert target.max() == 1
