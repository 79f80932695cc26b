"""Grammars of other packages and of scripts: found by name, loaded when they are asked for."""

from __future__ import annotations

import sys
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from d4cad.errors import InputError

GROUP = "d4cad.grammars"
"""The entry points under which a package names its grammars."""


def is_script(name: str) -> bool:
    """Whether a name is that of a script's grammar, MODULE:OBJECT or FILE.py:OBJECT, which runs code when loaded."""
    return ":" in name


def names() -> tuple[str, ...]:
    """The names of the grammars that installed packages offer, in order."""
    return tuple(sorted(_offered()))


def load(name: str) -> Any:
    """What is registered under a name, or what a script's name stands for.

    Raises InputError, one sentence, where that cannot be loaded.
    """
    try:
        return _script(name) if is_script(name) else _offered()[name].load()
    except Exception as error:  # other people's code may raise anything as it is imported
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"cannot load the grammar {name}: {reason}") from error


def _offered() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP)}


@cache
def _script(name: str) -> Any:
    """The object of a script, which is imported once: its classes must stay the same."""
    place, _, attribute = name.rpartition(":")
    module = _from_file(Path(place)) if place.endswith(".py") else _from_here(place)
    if not hasattr(module, attribute):
        raise InputError(f"{place} has no {attribute!r}")
    return getattr(module, attribute)


def _from_here(name: str) -> ModuleType:
    """A module as a script in the working folder would import it."""
    here = str(Path.cwd())
    sys.path.insert(0, here)
    try:
        return import_module(name)
    finally:
        sys.path.remove(here)


def _from_file(path: Path) -> ModuleType:
    if not path.is_file():
        raise InputError(f"there is no file {path}")
    name = f"d4cad_script_{path.stem}"
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path} is not a Python file")
    module = module_from_spec(spec)
    sys.modules[name] = module  # where dataclasses look their module up
    spec.loader.exec_module(module)
    return module
