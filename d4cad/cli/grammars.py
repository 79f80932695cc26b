"""`d4cad grammars`."""

from __future__ import annotations

import json
from typing import Any

import typer

from d4cad.cli.options import Json
from d4cad.cli.running import reported


def grammars(as_json: Json = False) -> None:
    """List all grammars installed, their rewrites with what is known of them, and their variants."""
    with reported():
        from d4cad.registry import names

        facts = {name: _facts(name) for name in names()}
        typer.echo(json.dumps(facts) if as_json else "\n\n".join(_text(name, part) for name, part in facts.items()))


def _facts(name: str) -> dict[str, Any]:
    """What is known of a grammar, or why another package's cannot be loaded."""
    from dataclasses import asdict

    from d4cad.errors import InputError
    from d4cad.registry import VARIANTS, entry

    try:
        found = entry(name)
    except InputError as error:
        return {"error": str(error)}
    variants = {key: variant for key, variant in VARIANTS.items() if variant.grammar == name}
    return {
        "counted": found.counted or "edge",
        "rewrites": {rule: asdict(fact) for rule, fact in found.rules.items()},
        "variants": {key: list(variant.rules) for key, variant in variants.items()},
        "notes": {key: variant.note for key, variant in variants.items() if variant.note},
    }


def _text(name: str, facts: dict[str, Any]) -> str:
    """One grammar, for people."""
    if "error" in facts:
        return f"{name}: {facts['error']}"
    rewrites = facts["rewrites"]
    width = max(len(rule) for rule in rewrites)
    lines = [f"{name}, whose programs count their {facts['counted']}s"]
    for rule, fact in rewrites.items():
        lines.append(f"  {rule.ljust(width)}  {fact['effect']}")
        kept = "the shape is the same" if fact["exact"] else "the shape changes"
        undone = f"undone by {fact['inverse']}" if fact["inverse"] else "no exact inverse"
        lines.append(f"  {' ' * width}  offered: {fact['guard']}; {kept}; {undone}")
    for variant, rules in facts["variants"].items():
        missing = [rule for rule in rewrites if rule not in rules]
        kept = f"without {', '.join(missing)}" if missing else "all rewrites"
        note = facts["notes"].get(variant)
        lines.append(f"  {variant.ljust(width)}  {kept}{f'; {note}' if note else ''}")
    return "\n".join(lines)
