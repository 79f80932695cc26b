"""Grammars, their variants and methods by the names they have on the command line.

A grammar of another package is an `Entry` that it names under the entry points "d4cad.grammars"; that of a script is
called MODULE:OBJECT or FILE.py:OBJECT (docs/grammar-authoring.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

from d4cad import plugins
from d4cad.canvas import Canvas
from d4cad.descent import Method
from d4cad.errors import InputError
from d4cad.grammars import arc_line, tree, union_rect
from d4cad.grammars.arc_line import ArcLine, sagitta_metric
from d4cad.grammars.arc_line import places as arc_places
from d4cad.grammars.tree import Limits, Tree
from d4cad.grammars.tree import places as tree_places
from d4cad.grammars.tree.leaves import DISC
from d4cad.grammars.union_rect import UnionRect, angle_metric
from d4cad.grammars.union_rect import places as rect_places
from d4cad.methods import (
    fast,
    fast_rectangles,
    fast_tree,
    general,
    general_paper,
    paper,
    paper_rectangles,
    paper_tree,
)
from d4cad.program import Floats
from d4cad.protocols import Grammar, RuleFacts

PAPER_LOSSY = 0.03
"""World length by which the paper lets a lossy rewrite move the outline (SPEC 3)."""
PAPER_THIN = 0.01
"""Half-size under which the paper's repair drops a rectangle (SPEC 4.2)."""
PAPER_RULES = ("split", "to-arc", "to-line", "merge-line", "merge-arc", "close", "add-loop", "remove-loop")

Rules = frozenset[str]


@dataclass(frozen=True, slots=True)
class Entry:
    """A grammar and how the methods use it.

    fast: the grammar with the given rules as the default method has it. rules: facts of all its rewrites by name.
    methods: their settings by name, given the canvas and the last price of a primitive in summed squared error; by
    default ones that suit any grammar. size: number of parameters of a structure, by default its ``size``. paper,
    paper_rules: the grammar and its rewrites as the paper has them, by default as ``fast`` and all. counted: what its
    programs count, if that is not the edges of the outline. for_target: the grammar with an axiom made for a target.
    area: whether its raster can be that of exact area coverage.
    """

    fast: Callable[[Canvas, Rules], Grammar[Any]]
    rules: Mapping[str, RuleFacts]
    methods: Mapping[str, Callable[[Canvas, float], Method]] = field(
        default_factory=lambda: {"fast": general, "paper": general_paper}
    )
    size: Callable[[Any], int] = attrgetter("size")
    paper: Callable[[Canvas, Rules], Grammar[Any]] | None = None
    paper_rules: tuple[str, ...] | None = None
    counted: str | None = None
    for_target: Callable[[Any, Floats, Canvas], Grammar[Any]] | None = None
    area: bool = False


@dataclass(frozen=True, slots=True)
class Variant:
    """A named ablation of the paper: a grammar with some of its rewrites, what else of the grammar differs, and that in
    words."""

    grammar: str
    rules: tuple[str, ...]
    settings: Mapping[str, Any] = field(default_factory=dict)
    note: str = ""


def _paper_arc_line(canvas: Canvas, rules: Rules) -> ArcLine:
    return ArcLine(canvas.pixel, rules, arc_places.UniformPlaces(), PAPER_LOSSY / canvas.pixel, arc_weight=1.0)


def _paper_union_rect(canvas: Canvas, rules: Rules) -> UnionRect:
    return UnionRect(
        canvas.pixel,
        rules,
        rect_places.UniformPlaces(),
        merge_reach=1.0,
        merge_limit=100.0,
        remove_limit=0.005,
        least=PAPER_THIN / canvas.pixel,
    )


def _paper_tree(canvas: Canvas, rules: Rules) -> Tree:
    return Tree(rules, places=tree_places.UniformPlaces(), reach=1, least=0.03)


GRAMMARS: dict[str, Entry] = {
    "arc-line": Entry(
        fast=lambda canvas, rules: ArcLine(canvas.pixel, rules),
        paper=_paper_arc_line,
        methods={"fast": fast, "paper": lambda canvas, floor: paper(canvas, sagitta_metric)},
        size=lambda structure: int(structure.layout.size),
        rules=arc_line.FACTS,
        paper_rules=PAPER_RULES,
        area=True,
    ),
    "union-rect": Entry(
        fast=lambda canvas, rules: UnionRect(canvas.pixel, rules),
        paper=_paper_union_rect,
        methods={"fast": fast_rectangles, "paper": lambda canvas, floor: paper_rectangles(canvas, angle_metric)},
        size=lambda structure: int(structure.size),
        rules=union_rect.FACTS,
        paper_rules=tuple(union_rect.FACTS),
        counted="rectangle",
    ),
    "tree": Entry(
        fast=lambda canvas, rules: Tree(rules),
        paper=_paper_tree,
        methods={"fast": fast_tree, "paper": lambda canvas, floor: paper_tree(canvas)},
        size=lambda structure: int(structure.size),
        rules=tree.FACTS,
        paper_rules=tuple(tree.FACTS),
        counted="node",
        for_target=Tree.made_for,
    ),
}


def _without(grammar: str, *rules: str) -> Variant:
    return Variant(grammar, tuple(rule for rule in GRAMMARS[grammar].paper_rules or () if rule not in rules))


def _tree(*rules: str, note: str = "", **settings: Any) -> Variant:
    """A variant with leaves of one size and the root at the bottom of the shape."""
    limits = Limits(sized=False)
    fixed: dict[str, Any] = {"limits": limits, "bottom": "shape", "tip": 0.075, "link": 0.075, "least": 0.0}
    return Variant("tree", rules, {**fixed, **settings}, f"leaves of one size, root at the bottom of the shape{note}")


VARIANTS = {
    "AL-1": _without("arc-line", "add-loop"),
    "AL-F": _without("arc-line"),
    "UR-1": _without("union-rect", "add-rect"),
    "UR-2": _without("union-rect", "add-hole"),
    "UR-F": _without("union-rect"),
    "Tr-1": _tree("add-leaf", sprout=0.2, note=", new branches at full length"),
    "Tr-2": _tree("add-leaf", "remove-leaf", sprout=0.2, note=", new branches at full length"),
    "Tr-3": _tree("add-leaf", "remove-leaf", guarded=True, note=", only short branches are removed"),
    "Tr-4": _tree("add-leaf", "split", "remove-leaf", "remove-branch"),
    "Tr-5": _tree("add-leaf", "split", "remove-leaf", "remove-branch", "add-anywhere"),
    "Tr-F": _without("tree"),
    "Tr-disc": Variant("tree", tuple(tree.FACTS), {"leaf": DISC}, "leaves are discs"),
}
"""The paper's ablations (SPEC 1.7), and trees of discs."""


def names() -> tuple[str, ...]:
    """The names of the grammars that are installed, d4cad's own first."""
    return (*GRAMMARS, *(name for name in plugins.names() if name not in GRAMMARS))


def entry(grammar: str) -> Entry:
    """The grammar's entry: d4cad's own, another package's, or, for MODULE:OBJECT and FILE.py:OBJECT, a script's.

    Raises InputError for an unknown name and for a grammar that cannot be loaded.
    """
    if grammar in GRAMMARS:
        return GRAMMARS[grammar]
    if not plugins.is_script(grammar) and grammar not in plugins.names():
        hint = f"; a script's is named {grammar}:OBJECT" if grammar.endswith(".py") else ""
        raise InputError(f"there is no grammar {grammar!r}, expected one of: {', '.join(names())}{hint}")
    found = plugins.load(grammar)
    if not isinstance(found, Entry):
        raise InputError(f"the grammar {grammar} should be a d4cad.registry.Entry, got {type(found).__name__}")
    return found


def make_grammar(
    grammar: str, method: str, canvas: Canvas, variant: str | None = None, target: Floats | None = None
) -> Grammar[Any]:
    """The grammar as ``method`` uses it on ``canvas``, with the rewrites of ``variant`` or all that the method has.

    target: coverage (height, width), row 0 lowest, that the grammar's axiom may look at. Raises InputError for an
    unknown name or a variant of another grammar.
    """
    found = entry(grammar)
    published = method == "paper"
    every = found.rules if found.paper_rules is None or not published else found.paper_rules
    rules, settings = frozenset(every), {}
    if variant is not None:
        if variant not in VARIANTS:
            raise InputError(f"there is no variant {variant!r}, expected one of: {', '.join(VARIANTS)}")
        if VARIANTS[variant].grammar != grammar:
            raise InputError(f"{variant} is a variant of {VARIANTS[variant].grammar}, not of {grammar}")
        rules, settings = frozenset(VARIANTS[variant].rules), dict(VARIANTS[variant].settings)
    make = found.paper if published and found.paper is not None else found.fast
    plain: Any = make(canvas, rules)
    made: Grammar[Any] = replace(plain, **settings) if settings else plain
    return found.for_target(made, target, canvas) if target is not None and found.for_target is not None else made


def make_method(method: str, canvas: Canvas, floor: float, grammar: str = "arc-line") -> Method:
    """The settings of ``method`` for ``grammar``; ``floor``: the last price of a primitive, in summed squared error.

    Raises InputError for an unknown name.
    """
    methods = entry(grammar).methods
    if method not in methods:
        raise InputError(f"there is no method {method!r}, expected one of: {', '.join(methods)}")
    return methods[method](canvas, floor)
