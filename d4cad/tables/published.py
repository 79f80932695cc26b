"""The figures of the paper's tables, for comparison: Kodnongbua et al., "Design for Descent", SIGGRAPH Asia 2025."""

from __future__ import annotations

from typing import NamedTuple


class Published(NamedTuple):
    """One cell of a table: PSNR in dB, primitives, seconds on the authors' machine; None where it has none."""

    psnr: float
    primitives: int | None = None
    seconds: float | None = None


SETS = ("onecomp", "donut", "twocomp")
"""The paper's sets in the order of the tuples below."""


def _cells(
    psnr: tuple[float, float, float],
    primitives: tuple[int, int, int] | None = None,
    seconds: tuple[int, int, int] | None = None,
) -> dict[str, Published]:
    return {
        name: Published(psnr[k], primitives and primitives[k], seconds and float(seconds[k]))
        for k, name in enumerate(SETS)
    }


PAPER: dict[str, dict[str, Published]] = {
    "AL-1": _cells((44.1, 11.4, 20.9), (9, 6, 10)),
    "AL-F": _cells((44.3, 48.1, 49.3), (9, 10, 11), (80, 106, 107)),
    "UR-1": _cells((26.3, 26.7, 20.3), (11, 13, 9)),
    "UR-2": _cells((26.7, 27.0, 26.1), (10, 12, 10)),
    "UR-F": _cells((27.6, 26.6, 26.9), (11, 14, 11), (88, 106, 75)),
    "Tr-1": _cells((15.4, 9.7, 10.3), (155, 93, 45)),
    "Tr-2": _cells((15.4, 9.7, 10.3), (145, 86, 42)),
    "Tr-3": _cells((21.5, 21.1, 11.4), (182, 195, 76)),
    "Tr-4": _cells((23.0, 21.3, 11.4), (206, 218, 85)),
    "Tr-5": _cells((23.2, 21.0, 14.6), (197, 208, 121)),
    "Tr-F": _cells((22.0, 21.7, 22.6), (246, 274, 212), (385, 437, 291)),
    "AL-F NoStep": _cells((30.7, 24.3, 31.8), None, (118, 154, 107)),
    "AL-F OneRewrite": _cells((40.0, 19.1, 24.0), None, (90, 126, 102)),
    "UR-F NoStep": _cells((25.1, 24.8, 24.7), None, (85, 89, 57)),
    "UR-F OneRewrite": _cells((26.9, 27.0, 26.4), None, (85, 109, 80)),
    "Tr-F NoStep": _cells((9.9, 10.4, 10.6), None, (181, 197, 107)),
    "Tr-F OneRewrite": _cells((19.4, 17.5, 18.4), None, (1047, 981, 662)),
}
"""Tables 2 and 3 by row and set."""

ORDER: tuple[tuple[str, str], ...] = (
    ("AL-F", "AL-1"),
    ("UR-F", "UR-1"),
    ("UR-F", "UR-2"),
    ("Tr-2", "Tr-1"),
    ("Tr-3", "Tr-2"),
    ("Tr-4", "Tr-3"),
    ("Tr-5", "Tr-4"),
    ("Tr-F", "Tr-5"),
    ("AL-F", "AL-F NoStep"),
    ("AL-F", "AL-F OneRewrite"),
    ("UR-F", "UR-F NoStep"),
    ("UR-F", "UR-F OneRewrite"),
    ("Tr-F", "Tr-F NoStep"),
    ("Tr-F", "Tr-F OneRewrite"),
    ("AL-F", "AL-F Fixed"),
    ("UR-F", "UR-F Fixed"),
    ("AL-F OneRewrite", "AL-F Fixed+OneRewrite"),
    ("UR-F OneRewrite", "UR-F Fixed+OneRewrite"),
)
"""Pairs of rows whose order the paper speaks of; of the fixed-step variants its figures are not at hand."""
