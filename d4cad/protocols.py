"""The small contracts between optimiser, grammar and objective."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from d4cad.canvas import Canvas
from d4cad.program import Curvature, Edit, Floats, Program, Rewrite
from d4cad.raster.band import Band

if TYPE_CHECKING:
    from d4cad.loop import Loop
    from d4cad.sketch import Sketch

S = TypeVar("S")
T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """An equation that the program must fulfil.

    residual: what must become zero. gradient: (n,) its derivative by the parameters.
    """

    residual: float
    gradient: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """A loss at a program.

    value: the loss. gradient: (n,) its derivative by the parameters. curvature: (n, n) Gauss-Newton approximation of
    its second derivative where the loss is a sum of squares; for a constrained loss the metric in which steps are
    measured; else None. constraint: what holds besides; the gradient is then that of the loss without it.
    """

    value: float
    gradient: Floats
    curvature: Floats | Curvature | None = None
    constraint: Constraint | None = None


@dataclass(frozen=True, slots=True)
class RuleFacts:
    """What is known of a kind of rewrite, for people and for tests.

    effect: what it does. guard: when it is offered. inverse: the kind of rewrite that undoes it, None if none does so
    exactly. exact: whether the shape is the same before and after, so that the raster does not jump.
    """

    effect: str
    guard: str = "always"
    inverse: str | None = None
    exact: bool = False


class Loss(Protocol):
    """A function of coverage, its randomness already drawn, so that programs are compared on the same noise."""

    def value(self, band: Band) -> float:
        """The loss of a raster."""
        ...

    def evaluate(self, band: Band) -> Evaluation:
        """The loss of a raster with its derivatives by the program's parameters."""
        ...

    def demand(self, band: Band) -> Floats:
        """Where more material would lower the loss: (height, width) in [-1, 1], negative where less would."""
        ...


class Objective(Protocol):
    """A distribution over losses."""

    def draw(self, rng: np.random.Generator) -> Loss:
        """One loss, its noise frozen."""
        ...


class Grammar(Protocol[S]):
    """A language of shapes: its programs, its rewrites, its rasters."""

    @property
    def name(self) -> str:
        """The name on the command line and in program files."""
        ...

    def axiom(self, canvas: Canvas) -> Program[S]:
        """The program that a search starts from."""
        ...

    def rewrites(self, program: Program[S], demand: Floats, canvas: Canvas, rng: np.random.Generator) -> list[Rewrite]:
        """The rewrites on offer; ``demand`` (height, width) says where material is wanted (Loss.demand)."""
        ...

    def growth(self, program: Program[S], rewrite: Rewrite) -> float:
        """By how much a rewrite changes the complexity."""
        ...

    def apply(self, program: Program[S], rewrites: Sequence[Rewrite]) -> Edit[S]:
        """Apply rewrites at disjoint sites together."""
        ...

    def repair(self, program: Program[S]) -> Edit[S]:
        """The nearest valid program of the same shape; the same object within if nothing had to change."""
        ...

    def complexity(self, program: Program[S]) -> float:
        """What the simplicity term prices."""
        ...

    def primitives(self, program: Program[S]) -> int:
        """Number of primitives, for reports."""
        ...

    def rasterize(self, program: Program[S], canvas: Canvas) -> Band:
        """Coverage of the program on a canvas with its derivative."""
        ...

    def outline(self, program: Program[S]) -> Sketch:
        """The exact outline in world units: the one bridge to CAD."""
        ...

    def encode(self, structure: S) -> Any:
        """The structure as JSON values."""
        ...

    def decode(self, value: Any) -> S:
        """The structure back from JSON values; GrammarError if they are not one."""
        ...


STIFF = 1e6
"""Stiffness of a grammar's bonds in prices of a primitive: off by a thousandth, a bond costs as much as one."""


@runtime_checkable
class Tracer(Grammar[Any], Protocol):
    """A grammar that can start from loops of lines and arcs."""

    def drawn(self, loops: Sequence[Loop]) -> Program[Any]:
        """The program of loops in world units, the inside on their left."""
        ...


@runtime_checkable
class Bonded(Protocol):
    """A grammar whose structures tie parameters to each other, beyond what a loss sees."""

    @property
    def binding(self) -> frozenset[str]:
        """The names of the rules that make or free bonds."""
        ...

    def ties(self, program: Program[Any]) -> list[Rewrite]:
        """The rewrites that make or free bonds and leave the shape nearly as it is."""
        ...

    def bonds(self, program: Program[Any]) -> tuple[Floats, Floats]:
        """What is to be 0, (k,), and its derivatives by the parameters, (k, n)."""
        ...

    def tightened(self, program: Program[Any]) -> Program[Any]:
        """The nearest program with all bonds 0."""
        ...


@runtime_checkable
class Composed(Protocol):
    """A grammar whose shapes are unions of rectangles, which CAD users may want by themselves."""

    def rectangles(self, program: Program[Any]) -> tuple[Sketch, ...]:
        """Every rectangle as a sketch in world units."""
        ...


class Stepper(Protocol[T]):
    """A continuous optimiser: pure functions on an explicit state, which is carried through rewrites."""

    def init(self, program: Program[Any]) -> T:
        """The state before the first step."""
        ...

    def carry(self, state: T, edit: Edit[Any]) -> T:
        """The state after the program was edited."""
        ...

    def step(self, program: Program[Any], evaluation: Evaluation, state: T) -> tuple[Floats, T]:
        """The next parameters, given the loss at ``program``."""
        ...

    def best(self, params: Floats, value: float, state: T) -> tuple[Floats, float]:
        """What a run of steps is left with, given the loss at its last parameters."""
        ...

    def settled(self, state: T) -> bool:
        """Whether further steps on the same program would gain nothing."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A rewrite with the decrease of loss plus simplicity that it promises."""

    rewrite: Rewrite
    gain: float


class Estimator(Protocol):
    """How the improvement by each rewrite is foretold."""

    def estimate(
        self,
        program: Program[S],
        rewrites: Sequence[Rewrite],
        grammar: Grammar[S],
        loss: Loss,
        canvas: Canvas,
        price: float,
    ) -> list[Trial]:
        """Trials of the rewrites, at least of those that pay; ``price``: the loss that one unit of complexity may
        cost.
        """
        ...
