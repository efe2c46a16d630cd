"""MkDocs hook: puts a notebook with its stored outputs where a page says `<!-- notebook NAME.ipynb -->`."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

MARK = re.compile(r"<!-- notebook (\w+\.ipynb) -->")
NOTEBOOKS = Path(__file__).resolve().parent.parent / "notebooks"


def on_page_markdown(markdown: str, **_: object) -> str:
    """Replace the mark by the notebook's cells: text, code, and what the code printed and showed."""
    found = MARK.search(markdown)
    if not found:
        return markdown
    notebook = json.loads((NOTEBOOKS / found[1]).read_text(encoding="utf-8"))
    cells = "\n\n".join(part for cell in notebook["cells"] for part in _parts(cell))
    return markdown.replace(found[0], cells)


def _parts(cell: dict[str, Any]) -> Iterator[str]:
    source = "".join(cell["source"])
    if cell["cell_type"] == "markdown":
        yield source
        return
    yield f"```python\n{source}\n```"
    for output in cell["outputs"]:
        shown = output.get("data", {})
        if "text/html" in shown:
            # On one line: Markdown ends a block of HTML at an empty line.
            yield "".join(shown["text/html"]).replace("\n", "&#10;")
        else:
            yield f"```text\n{''.join(output.get('text') or shown['text/plain']).rstrip()}\n```"
