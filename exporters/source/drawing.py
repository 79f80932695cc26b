"""A sketch some of whose coordinates have become linear in named parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from d4cad.exporters.source.linear import Linear
from d4cad.exporters.source.places import Place
from d4cad.loop import Loop, Point
from d4cad.sketch import Sketch

SAME = 1e-8
"""Share of the sketch's extent within which coordinates are equal: those that regularisation has made so are."""

Key = tuple[int, int, int]
"""Axis (0: x, 1: y), loop, and vertex, or CENTER."""
CENTER = -1


@dataclass(eq=False)
class Drawing:
    """A sketch in mm, and what was found in it so far.

    names: of the loops whose points are written, by index: those of edges, and those of ``circles``, of which the
    centres are given. decimals: of parameters. places: the coordinates that are computed. values, notes: of every
    parameter by name. formulas: of those that follow from the others. coordinates: the parameters that are some.
    radii: the parameter of an arc by its ends. level: axis, loop and edge, of lines along which that coordinate is the
    same.
    """

    sketch: Sketch
    names: Mapping[int, str]
    circles: Mapping[int, Point]
    decimals: int
    places: dict[Key, Linear] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    formulas: dict[str, Linear] = field(default_factory=dict)
    coordinates: list[str] = field(default_factory=list)
    radii: dict[tuple[Point, Point], str] = field(default_factory=dict)
    level: set[Key] = field(default_factory=set)

    @cached_property
    def loops(self) -> tuple[Loop, ...]:
        """Those of the sketch."""
        return self.sketch.loops

    @cached_property
    def slack(self) -> float:
        """Length within which coordinates are equal."""
        xmin, ymin, xmax, ymax = self.sketch.bounds
        return SAME * max(xmax - xmin, ymax - ymin)

    def at(self, key: Key) -> float:
        """A coordinate as it is."""
        axis, loop, vertex = key
        return (self.circles[loop] if vertex == CENTER else self.loops[loop].points[vertex])[axis]

    def expression(self, key: Key) -> Linear:
        """A coordinate as it is computed."""
        return self.places.get(key) or Linear(self.at(key))

    def vertex(self, loop: int, k: int) -> Place:
        """A vertex as it is computed."""
        return self.expression((0, loop, k)), self.expression((1, loop, k))

    def equal(self, a: Key, b: Key) -> bool:
        """Whether two coordinates are the same."""
        return abs(self.at(a) - self.at(b)) <= self.slack

    def after(self, loop: int, k: int) -> int:
        """The vertex at which an edge ends."""
        return (k + 1) % len(self.loops[loop].points)

    def has_edges(self, loop: int) -> bool:
        """Whether its edges are written."""
        return loop in self.names and loop not in self.circles

    def name(self, name: str, members: Sequence[Key], value: float | None = None, note: str = "") -> None:
        """Makes the coordinates one parameter; its value is their mean unless given."""
        mean = sum(map(self.at, members)) / len(members) if value is None else value
        self.values[name] = round(mean, self.decimals) + 0.0
        self.notes[name] = note
        self.coordinates.append(name)
        for key in members:
            self.places[key] = Linear.of(name)


class Groups:
    """Coordinates that are equal, as a disjoint-set forest."""

    def __init__(self) -> None:
        self.home: dict[Key, Key] = {}

    def root(self, key: Key) -> Key:
        """The one that stands for all that are equal."""
        while self.home.setdefault(key, key) != key:
            key = self.home[key]
        return key

    def join(self, a: Key, b: Key) -> None:
        """Makes two equal, and all that are."""
        self.home[self.root(b)] = self.root(a)

    def of(self, axis: int) -> list[list[Key]]:
        """Those along an axis, in the order in which they came."""
        found: dict[Key, list[Key]] = {}
        for key in self.home:
            if key[0] == axis:
                found.setdefault(self.root(key), []).append(key)
        return list(found.values())
