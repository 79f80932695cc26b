"""What the denoisers of plain pixels share: a picture's code is 2 coverage - 1, and the schedule is the cosine's."""

from __future__ import annotations

from math import cos, pi, sin

from d4cad.objectives.distillation import Encoded
from d4cad.program import Floats


def cosine(time: float) -> tuple[float, float]:
    """alpha and sigma at a time from 0 to 1: cos and sin of time times a right angle (https://arxiv.org/abs/2202.00512)."""
    return cos(time * pi / 2), sin(time * pi / 2)


def encoded(pictures: Floats) -> Encoded:
    """The codes (b, 1, size, size) of coverages (b, size, size), and how a gradient goes back."""
    return Encoded((2 * pictures - 1)[:, None], lambda gradient: 2 * gradient[:, 0])
