"""`d4cad grammars`."""

from __future__ import annotations

import json
from typing import Any

import typer

from d4cad.cli.options import Json
from d4cad.cli.running import reported


def grammars(as_json: Json = False) -> None:
    """List the grammars, their rewrites with what is known of them, and their variants."""
    with reported():
        from dataclasses import asdict

        from d4cad.registry import GRAMMARS, VARIANTS

        facts = {
            name: {
                "counted": entry.counted or "edge",
                "rewrites": {rule: asdict(fact) for rule, fact in entry.rules.items()},
                "variants": {key: list(v.rules) for key, v in VARIANTS.items() if v.grammar == name},
                "notes": {key: v.note for key, v in VARIANTS.items() if v.grammar == name and v.note},
            }
            for name, entry in GRAMMARS.items()
        }
        typer.echo(json.dumps(facts) if as_json else "\n\n".join(_text(name, part) for name, part in facts.items()))


def _text(name: str, facts: dict[str, Any]) -> str:
    """One grammar, for people."""
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
