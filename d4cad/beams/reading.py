"""Problems from TOML files. What is wrong is told with its line."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Set
from dataclasses import dataclass
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import Any

from d4cad.beams.problem import NEAR, Load, Material, Place, Point, Problem, Support
from d4cad.errors import InputError
from d4cad.files import read_text

TOP = {"name", "volume", "thickness", "domain", "material", "support", "load", "cut", "void", "solid"}
PLACES = {"at", "from", "to", "box", "circle"}

BLAMED = (
    ("the volume", (), "volume"),
    ("the thickness", (), "thickness"),
    ("the domain", ("domain",), "size"),
    ("an element", ("domain",), "element"),
    ("elements", ("domain",), "element"),
    ("Young", ("material",), "young"),
    ("Poisson", ("material",), "poisson"),
    ("the yield", ("material",), "yield"),
)
"""How a problem's and a material's own complaints begin, and the table and key that they are about."""


def read_problem(path: str | PathLike[str], volume: float | None = None) -> Problem:
    """The problem in a TOML file, with another ``volume`` if one is given.

    Raises InputError that names the file and, for what is wrong in it, the line.
    """
    path = Path(path)
    text = read_text(path, "problem file")
    try:
        return parse_problem(text, path.stem, volume)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def parse_problem(text: str, name: str = "beam", volume: float | None = None) -> Problem:
    """The problem in a TOML text; ``name`` if it has none. Raises InputError with the line."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"it is not TOML: {error}") from None
    except RecursionError:
        raise InputError("it is nested too deeply") from None
    return _Reader(text).problem(document, name, volume)


@dataclass(frozen=True, slots=True)
class _Reader:
    text: str

    def problem(self, document: Mapping[str, Any], name: str, volume: float | None) -> Problem:
        self._known(document, TOP, ())
        domain = self._table(document, "domain", {"size", "element"})
        material = self._table(document, "material", {"young", "poisson", "yield"})
        if "domain" not in document:
            raise InputError("it has no [domain] table with size and element")
        share = document.get("volume") if volume is None else volume
        if share is None:
            raise InputError("it states no volume, the share of the domain that may be material")
        try:
            found = Problem(
                name=str(document.get("name", name)),
                size=self._point(domain, "size", ("domain",)),
                element=self._number(domain, "element", ("domain",)),
                volume=share if volume is not None else self._number(document, "volume", ()),
                supports=tuple(self._support(item, ("support", k)) for k, item in self._items(document, "support")),
                loads=tuple(self._load(item, ("load", k)) for k, item in self._items(document, "load")),
                material=Material(
                    self._number(material, "young", ("material",), 210e3),
                    self._number(material, "poisson", ("material",), 0.3),
                    self._number(material, "yield", ("material",)) if "yield" in material else None,
                ),
                thickness=self._number(document, "thickness", (), 10.0),
                **{
                    f"{kind}s": tuple(self._place(item, (kind, k)) for k, item in self._items(document, kind))
                    for kind in ("cut", "void", "solid")
                },
            )
        except InputError as error:
            raise self._blamed(error, volume is not None) from None
        width, height = found.size
        for kind in ("support", "load", "cut", "void", "solid"):
            for k, item in self._items(document, kind):
                place = self._place(item, (kind, k), {"fix", "force", "case"})
                if place.misses(width, height, NEAR * found.element):
                    key = next(key for key in item if key in PLACES)
                    message = f"the {kind} at {place} lies outside of the domain of {width:g} x {height:g} mm"
                    raise self._error(message, (kind, k), key)
        return found

    def _support(self, item: Mapping[str, Any], where: tuple[str, int]) -> Support:
        self._known(item, PLACES | {"fix"}, where)
        fix = item.get("fix", "xy")
        if fix not in ("x", "y", "xy"):
            raise self._error(f'fix must be "x", "y" or "xy", got {fix!r}', where, "fix")
        return Support(self._place(item, where, {"fix"}), fix)

    def _load(self, item: Mapping[str, Any], where: tuple[str, int]) -> Load:
        self._known(item, PLACES | {"force", "case"}, where)
        return Load(
            self._place(item, where, {"force", "case"}), self._point(item, "force", where), str(item.get("case", ""))
        )

    def _place(self, item: Mapping[str, Any], where: tuple[str, int], others: Set[str] = frozenset()) -> Place:
        self._known(item, PLACES | others, where)
        keys = PLACES & set(item)
        if keys == {"at"}:
            at = self._point(item, "at", where)
            return Place(at, at)
        if keys == {"from", "to"}:
            return Place(self._point(item, "from", where), self._point(item, "to", where))
        if keys == {"box"}:
            x0, y0, x1, y1 = self._numbers(item, "box", 4, where)
            if not (x0 < x1 and y0 < y1):
                raise self._error("box must be [xmin, ymin, xmax, ymax] with xmin < xmax and ymin < ymax", where, "box")
            return Place((x0, y0), (x1, y1), box=True)
        if keys == {"circle"}:
            x, y, radius = self._numbers(item, "circle", 3, where)
            if radius <= 0:
                raise self._error(f"the radius of a circle must be positive, got {radius:g}", where, "circle")
            return Place((x, y), (x, y), radius)
        raise self._error("a place is one of: at; from and to; box; circle", where, None)

    def _items(self, document: Mapping[str, Any], key: str) -> list[tuple[int, Mapping[str, Any]]]:
        value = document.get(key, [])
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
            raise self._error(f"{key} must be written as [[{key}]]", (), key)
        return list(enumerate(value))

    def _table(self, document: Mapping[str, Any], key: str, known: set[str]) -> Mapping[str, Any]:
        value = document.get(key, {})
        if not isinstance(value, dict):
            raise self._error(f"{key} must be a table, written as [{key}]", (), key)
        self._known(value, known, (key,))
        return value

    def _known(self, item: Mapping[str, Any], known: set[str], where: tuple[Any, ...]) -> None:
        for key in item:
            if key not in known:
                raise self._error(f"unknown key {key!r}, expected one of {', '.join(sorted(known))}", where, key)

    def _point(self, item: Mapping[str, Any], key: str, where: tuple[Any, ...]) -> Point:
        x, y = self._numbers(item, key, 2, where)
        return x, y

    def _numbers(self, item: Mapping[str, Any], key: str, count: int, where: tuple[Any, ...]) -> list[float]:
        value = item.get(key)
        good = isinstance(value, list) and len(value) == count and all(_is_number(v) for v in value)
        if not good:
            raise self._error(f"{key} must be {count} numbers, got {value!r}", where, key)
        return [float(v) for v in value or ()]

    def _number(self, item: Mapping[str, Any], key: str, where: tuple[Any, ...], default: float | None = None) -> float:
        value = item.get(key, default)
        if not _is_number(value):
            raise self._error(f"{key} must be a number, got {value!r}", where, key)
        return float(value)

    def _blamed(self, error: InputError, volume_given: bool) -> InputError:
        """The error with the line of the key that it is about, unless it names one or the file does not state it."""
        message = str(error)
        for beginning, where, key in BLAMED:
            if message.startswith(beginning) and not (key == "volume" and volume_given):
                return self._error(message, where, key)
        return error

    def _error(self, message: str, where: tuple[Any, ...], key: str | None) -> InputError:
        return InputError(f"line {self._line(where, key)}: {message}")

    def _line(self, where: tuple[Any, ...], key: str | None) -> int:
        """The line of a key in a table, or of the table's head."""
        table, seen, head, current = (where[0] if where else ""), -1, 1, ""
        wanted = where[1] if len(where) > 1 else 0
        for number, line in enumerate(self.text.splitlines(), 1):
            header = re.match(r"\s*\[\[?\s*([\w.-]+)\s*\]", line)
            if header:
                current = header[1]
                seen += current == table
                head = number if current == table and seen == wanted else head
            matches = key is not None and re.match(rf"\s*[\"']?{re.escape(key)}[\"']?\s*[=.]", line)
            if matches and current == table and (seen == wanted or not table):
                return number
            if header and not where and header[1] == key:
                return number
        return head


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and isfinite(value)
