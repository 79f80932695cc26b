"""Linear combinations of named parameters, as they are written in source code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from d4cad.exporters.source.words import number

NOTHING = 1e-12
"""Coefficients and constants below this are rounding."""
FACTOR_DECIMALS = 12


@dataclass(frozen=True, slots=True)
class Linear:
    """``constant`` plus the sum of the ``terms``, pairs of a parameter's name and its factor; each name comes once.

    >>> str(Linear.of("top") - Linear.of("radius", 0.5) + Linear(3.0))
    'top + 3 - radius / 2'
    """

    constant: float = 0.0
    terms: tuple[tuple[str, float], ...] = ()

    @classmethod
    def of(cls, name: str, factor: float = 1.0) -> Linear:
        """One parameter, times ``factor``."""
        return cls(0.0, ((name, factor),))

    def __add__(self, other: Linear) -> Linear:
        factors = dict(self.terms)
        for name, factor in other.terms:
            factors[name] = factors.get(name, 0.0) + factor
        kept = tuple((name, factor) for name, factor in factors.items() if abs(factor) > NOTHING)
        return Linear(self.constant + other.constant, kept)

    def __sub__(self, other: Linear) -> Linear:
        return self + other.times(-1.0)

    def times(self, factor: float) -> Linear:
        """Every part multiplied."""
        return Linear(factor * self.constant, tuple((name, factor * each) for name, each in self.terms))

    def factor(self, name: str) -> float:
        """That of a parameter, 0 if it does not occur."""
        return dict(self.terms).get(name, 0.0)

    def substituted(self, formulas: Mapping[str, Linear]) -> Linear:
        """With the formulas in place of the names that have one."""
        result = Linear(self.constant)
        for name, factor in self.terms:
            result += formulas[name].times(factor) if name in formulas else Linear.of(name, factor)
        return result

    def value(self, values: Mapping[str, float]) -> float:
        """Its value at those of the parameters."""
        return self.constant + sum(factor * values[name] for name, factor in self.terms)

    def text(self, decimals: int) -> str:
        """As source code in every dialect, the constant to ``decimals``; what is added comes first."""
        parts = [(factor > 0, _term(name, abs(factor))) for name, factor in self.terms]
        constant = number(abs(self.constant), decimals)
        if constant != "0" or not parts:
            parts.append((self.constant > 0 or constant == "0", constant))
        parts.sort(key=lambda part: not part[0])
        (positive, first), *rest = parts
        return ("" if positive else "-") + first + "".join(f" {'+' if plus else '-'} {each}" for plus, each in rest)

    def __str__(self) -> str:
        return self.text(9)


def _term(name: str, factor: float) -> str:
    if abs(factor - 1) < NOTHING:
        return name
    if abs(factor - 0.5) < NOTHING:
        return f"{name} / 2"
    return f"{number(factor, FACTOR_DECIMALS)} * {name}"
