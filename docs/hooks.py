"""What MkDocs calls while it builds the site."""

from __future__ import annotations

import re
from typing import Any

ROLE = re.compile(r":(?:class|func|meth|mod|attr):(?=<code>|`)")
LINK = re.compile(r"\]\((?:\.\./)*((?:d4cad|grammars|exporters|examples|benchmarks|tests)/[^)]*)\)")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Links into the source tree, which the site does not hold, become names of files."""
    return LINK.sub(r"] (`\1`)", markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Docstrings name things in Sphinx' way: the name is enough."""
    return ROLE.sub("", html)
