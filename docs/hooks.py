"""What MkDocs calls while it builds the site."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

ROLE = re.compile(r":(?:class|func|meth|mod|attr):(?=<code>|`)")
LINK = re.compile(r"\]\((?:\.\./)*((?:d4cad|grammars|exporters|examples|benchmarks|tests)/[^)]*)\)")


def on_config(config: Any) -> Any:
    """Only pages that exist are listed, and sections that hold one."""
    config["nav"] = listed(config["nav"], Path(config["docs_dir"]))
    return config


def listed(entries: list[dict[str, Any]], folder: Path) -> list[dict[str, Any]]:
    """The entries of a navigation whose pages are in the folder."""
    found = []
    for entry in entries:
        ((title, page),) = entry.items()
        kept = listed(page, folder) if isinstance(page, list) else (folder / page).is_file() and page
        if kept:
            found.append({title: kept})
    return found


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Links into the source tree, which the site does not hold, become names of files."""
    return LINK.sub(r"] (`\1`)", markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Docstrings name things in Sphinx' way: the name is enough."""
    return ROLE.sub("", html)
