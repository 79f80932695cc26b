"""What the tables compare: grammars with some of their rewrites, and searches with one thing left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from d4cad.canvas import Canvas
from d4cad.descent import Method
from d4cad.errors import InputError
from d4cad.program import Floats
from d4cad.protocols import Grammar
from d4cad.registry import VARIANTS, make_grammar, make_method

FAMILIES = {"AL": "arc-line", "UR": "union-rect", "Tr": "tree"}
"""Grammars by the letters with which the names of their variants begin."""
ALL = "all"
"""The name of a variant that has every rewrite of its grammar, beyond the paper's too."""
FIXED_RATE = {"arc-line": 0.05, "union-rect": 0.02}
"""The constant rates of the paper's fixed-step variants (SPEC 1.7)."""

Ablation = Callable[[Method, str], Method]
"""Settings of a search for a grammar of this name, changed."""


def no_step(method: Method, grammar: str) -> Method:
    """Proposals are compared as they stand: no step is taken in a trial."""
    estimator: Any = method.estimator
    return replace(method, estimator=replace(estimator, steps=0))


def one_rewrite(method: Method, grammar: str) -> Method:
    """Only the best rewrite of a round is applied."""
    return replace(method, accept=1)


def fixed(method: Method, grammar: str) -> Method:
    """Steps do not adapt: a constant rate, or for Levenberg-Marquardt a constant damping."""
    stepper: Any = method.stepper
    estimator: Any = method.estimator
    if not hasattr(stepper, "rate"):
        return replace(method, stepper=replace(stepper, factor=1.0))
    rate = FIXED_RATE[grammar]
    stepper = replace(stepper, rate=rate, least=rate)
    return replace(method, stepper=stepper, estimator=replace(estimator, stepper=stepper))


ABLATIONS: Mapping[str, tuple[Ablation, ...]] = {
    "Full": (),
    "NoStep": (no_step,),
    "OneRewrite": (one_rewrite,),
    "Fixed": (fixed,),
    "Fixed+OneRewrite": (fixed, one_rewrite),
}
"""The paper's searches with one thing left out, by its names for them."""


@dataclass(frozen=True, slots=True)
class Setting:
    """One row of a table.

    method: "paper" or "fast". variant: of a grammar, such as AL-1, or AL-all for all its rewrites. ablation: one of
    ABLATIONS.
    """

    method: str
    variant: str
    ablation: str = "Full"

    @property
    def grammar(self) -> str:
        """The grammar's name."""
        return FAMILIES[self.variant.split("-", 1)[0]]

    @property
    def label(self) -> str:
        """Variant and ablation, as on a table's row."""
        return self.variant if self.ablation == "Full" else f"{self.variant} {self.ablation}"

    @property
    def is_random(self) -> bool:
        """Whether seeds differ in anything: the default method draws no random number."""
        return self.method != "fast"

    def search(self, canvas: Canvas, target: Floats, floor: float) -> tuple[Grammar[Any], Method]:
        """The grammar and the settings of its search; ``floor``: as for `d4cad.registry.make_method`."""
        variant = None if self.variant.endswith(f"-{ALL}") else self.variant
        method = make_method(self.method, canvas, floor, self.grammar)
        for change in ABLATIONS[self.ablation]:
            method = change(method, self.grammar)
        return make_grammar(self.grammar, self.method, canvas, variant, target), method


VARIANT_ROWS = tuple(name for name in VARIANTS if name != "Tr-disc")
FULL_VARIANTS = tuple(f"{family}-F" for family in FAMILIES)


def settings(methods: Sequence[str], only: Sequence[str] = ()) -> list[Setting]:
    """All rows of all tables for the methods; with ``only`` those of the named variants.

    Raises InputError for an unknown name.
    """
    for method in methods:
        if method not in ("paper", "fast"):
            raise InputError(f"there is no method {method!r}, expected paper or fast")
    known = (*VARIANT_ROWS, *(f"{family}-{ALL}" for family in FAMILIES))
    for name in only:
        if name not in known:
            raise InputError(f"there is no variant {name!r}, expected one of: {', '.join(known)}")
    found = []
    for method in methods:
        found += [Setting(method, variant) for variant in VARIANT_ROWS]
        if method == "fast":
            found += [Setting(method, f"{family}-{ALL}") for family in FAMILIES]
        for variant in FULL_VARIANTS:
            names = ["NoStep", "OneRewrite"]
            if FAMILIES[variant[:2]] in FIXED_RATE:
                names += ["Fixed", "Fixed+OneRewrite"]
            found += [Setting(method, variant, name) for name in names]
    return [setting for setting in found if not only or setting.variant in only]
