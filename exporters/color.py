"""Colours as users write them."""

from __future__ import annotations

from d4cad.errors import InputError

Rgb = tuple[int, int, int]
"""Red, green and blue of sRGB, from 0 to 255."""


def rgb(color: str) -> Rgb:
    """A colour of ``#rrggbb`` or of a CSS name.

    Raises InputError for anything else, transparency included.

    >>> rgb("SteelBlue"), rgb("#ff8000")
    ((70, 130, 180), (255, 128, 0))
    """
    from PIL import ImageColor

    message = f"a color must be #rrggbb or a CSS name such as steelblue, got {color!r}"
    try:
        found = ImageColor.getrgb(color.strip())
    except ValueError as error:
        raise InputError(message) from error
    if len(found) != 3:
        raise InputError(message)
    return found


def hexadecimal(color: str) -> str:
    """The same as #RRGGBB."""
    red, green, blue = rgb(color)
    return f"#{red:02X}{green:02X}{blue:02X}"


def linear(color: str) -> tuple[float, float, float]:
    """The same as shares of light, as renderers reckon: the transfer function of IEC 61966-2-1 undone.

    https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html#metallic-roughness-material wants this of a glTF.
    """
    red, green, blue = (_linear(value / 255) for value in rgb(color))
    return red, green, blue


def _linear(value: float) -> float:
    return value / 12.92 if value <= 0.04045 else float(((value + 0.055) / 1.055) ** 2.4)
