"""The four properties by which the paper judges a shape grammar, measured on random programs: reversibility, jump
continuity, local control and repairability. Any grammar will do: all is seen through its rasters.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from d4cad.canvas import Canvas
from d4cad.errors import InputError
from d4cad.laboratory import SAME, SEEN, Laboratory, Shot, span
from d4cad.protocols import RuleFacts
from d4cad.registry import entry, make_grammar, make_method

BACK = 1.0
"""Summed squared change of coverage (px2) below which a shape that was fitted again is back: that of one pixel."""
SHAKES = 8
"""Times that each program is thrown out of its order for repair."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Median, 90 % quantile and maximum."""

    median: float
    high: float
    most: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Those of some values; zeros where there are none."""
        if len(values) == 0:
            return cls(0.0, 0.0, 0.0)
        median, high, most = np.quantile(np.asarray(values), [0.5, 0.9, 1.0]).tolist()
        return cls(median, high, most)


@dataclass(frozen=True, slots=True)
class RuleReport:
    """What a kind of rewrite did to random programs.

    tries: how many were applied. same: share that left the shape as it was. jump: change of the shape, summed squared
    change of coverage in px2. refitted: what is left of it when the new program is fitted to the old shape. undone:
    share that one rewrite leads back from to the same shape with the same complexity. mended: share that one leads
    back from to BACK when fitted. inverse: the kind of rewrite that most often leads back nearest, None if none is ever
    offered. reach: share of the boundary that it changes or that its new parameters move. span: how far those pixels
    lie apart, against the whole boundary's 1. jumps, reaches: every single value, for pictures.
    """

    rule: str
    tries: int
    same: float
    jump: Spread
    refitted: Spread
    undone: float
    mended: float
    inverse: str | None
    reach: Spread
    span: Spread
    jumps: tuple[float, ...] = field(repr=False)
    reaches: tuple[float, ...] = field(repr=False)


@dataclass(frozen=True, slots=True)
class Control:
    """What single parameters move: reach and span as in a RuleReport. idle: share of those that move nothing."""

    reach: Spread
    span: Spread
    idle: float
    reaches: tuple[float, ...] = field(repr=False)


@dataclass(frozen=True, slots=True)
class Repairs:
    """What repair did to programs whose parameters were moved at random.

    tries: how many there were. violated: share that needed repair. repaired: share of those in which a second repair
    finds nothing to do. drawable: share of all that bound a region afterwards. change: of the shape by repair, px2.
    """

    tries: int
    violated: float
    repaired: float
    drawable: float
    change: Spread
    changes: tuple[float, ...] = field(repr=False)


@dataclass(frozen=True, slots=True)
class Report:
    """A grammar's properties. primitives: least and greatest number of the random programs. unseen: kinds of rewrites
    that none of them offered. broken: what the grammar says of its rewrites that did not hold, a sentence each."""

    grammar: str
    seed: int
    programs: int
    pixels: int
    primitives: tuple[int, int]
    rules: tuple[RuleReport, ...]
    control: Control
    repairs: Repairs
    unseen: tuple[str, ...]
    broken: tuple[str, ...]


def measure(
    name: str,
    *,
    programs: int = 24,
    seed: int = 0,
    pixels: int = 128,
    tell: Callable[[int, int], None] | None = None,
) -> Report:
    """Measure the grammar of a name, in the default method's settings, on so many random programs on a square canvas.

    tell: called with the number of programs done, and of all. Raises InputError for an unknown grammar or numbers that
    are out of range.
    """
    if not (programs >= 1 and seed >= 0 and 32 <= pixels <= 1024):
        got = f"{programs}, {seed} and {pixels}"
        raise InputError(f"expected at least 1 program, a seed from 0 on and 32 to 1024 pixels, got {got}")
    canvas, rng, facts = Canvas.square(pixels), np.random.default_rng(seed), entry(name).rules
    grammar = make_grammar(name, "fast", canvas)
    lab = Laboratory(grammar, canvas, make_method("fast", canvas, 0.0, name).stepper, rng, facts)
    shots: dict[str, list[Shot]] = {rule: [] for rule in facts}
    reaches, spans, counts, idle, numbers = list[float](), list[float](), list[int](), 0, 0
    shakes: list[tuple[bool, bool, bool, float]] = []
    for done in range(programs):
        if tell is not None:
            tell(done, programs)
        program, target = lab.random_program()
        counts.append(grammar.primitives(program))
        influence = lab.influence(program, np.arange(program.params.size))
        seen = np.abs(influence) > SEEN * np.abs(influence).max(axis=(1, 2), keepdims=True, initial=0.0)
        moving = seen.any(axis=(1, 2))
        idle, numbers = idle + int(np.count_nonzero(~moving)), numbers + len(moving)
        border = lab.border(program)
        reaches += [float((one & border).sum() / border.sum()) for one in seen[moving]]
        spans += [span(one & border, border) for one in seen[moving]]
        for shot in lab.shots(program, target):
            shots.setdefault(shot.rule, []).append(shot)
        shakes += [lab.shake(program, influence) for _ in range(SHAKES)]
    rules = tuple(_rule_report(rule, found) for rule, found in shots.items() if found)
    return Report(
        grammar=name,
        seed=seed,
        programs=programs,
        pixels=pixels,
        primitives=(min(counts), max(counts)),
        rules=rules,
        control=Control(Spread.of(reaches), Spread.of(spans), idle / numbers, tuple(reaches)),
        repairs=_repairs(shakes),
        unseen=tuple(rule for rule, found in shots.items() if not found),
        broken=tuple(_broken(facts, rules)),
    )


def _rule_report(rule: str, shots: Sequence[Shot]) -> RuleReport:
    inverses = Counter(shot.inverse for shot in shots if shot.inverse is not None)
    jumps, reaches = [shot.jump for shot in shots], [shot.reach for shot in shots]
    return RuleReport(
        rule=rule,
        tries=len(shots),
        same=float(np.mean([jump < SAME for jump in jumps])),
        jump=Spread.of(jumps),
        refitted=Spread.of([shot.refitted for shot in shots]),
        undone=float(np.mean([shot.back < SAME for shot in shots])),
        mended=float(np.mean([shot.mended < BACK for shot in shots])),
        inverse=inverses.most_common(1)[0][0] if inverses else None,
        reach=Spread.of(reaches),
        span=Spread.of([shot.span for shot in shots]),
        jumps=tuple(jumps),
        reaches=tuple(reaches),
    )


def _repairs(shakes: Sequence[tuple[bool, bool, bool, float]]) -> Repairs:
    broken = [shake for shake in shakes if shake[0]]
    changes = [change for *_, change in broken]
    return Repairs(
        tries=len(shakes),
        violated=len(broken) / len(shakes),
        repaired=float(np.mean([settled for _, settled, _, _ in broken])) if broken else 1.0,
        drawable=float(np.mean([drawable for _, _, drawable, _ in shakes])),
        change=Spread.of(changes),
        changes=tuple(changes),
    )


def _broken(facts: Any, rules: Sequence[RuleReport]) -> Iterator[str]:
    for found in rules:
        fact: RuleFacts | None = facts.get(found.rule)
        if fact is None:
            yield f"{found.rule} is offered but not among the grammar's rules"
        elif fact.exact and found.jump.most > SAME:
            yield f"{found.rule} is said to leave the shape as it is, but changes it by up to {found.jump.most:.2g} px2"
