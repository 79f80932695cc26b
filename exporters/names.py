"""Names of parts, which may come from file names and hold anything."""

from __future__ import annotations


def printable(name: str) -> str:
    """The name without what XML and JSON cannot hold: control characters are dropped, half surrogates become "?"."""
    whole = name.encode("utf-8", "replace").decode("utf-8")
    return "".join(c for c in whole if c >= " " and c not in "\x7f\ufffe\uffff")
