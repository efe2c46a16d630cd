"""Run the notebooks and store what they print and show, as `jupyter execute --inplace` does, without a kernel.

    python docs/notebooks/execute.py [NAME …]

Each notebook runs in an empty folder. The last expression of a cell is shown as HTML where it can be, else as text.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
NOTEBOOKS = ("rover", "class", "stateful", "fmu")


def executed(notebook: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return a notebook with the outputs of its cells, run one after the other in a folder."""
    names: dict[str, Any] = {"__name__": "__main__"}
    cells, count = [], 0
    before = Path.cwd()
    os.chdir(folder)
    try:
        for cell in notebook["cells"]:
            if cell["cell_type"] != "code":
                cells.append(cell)
                continue
            count += 1
            outputs = _outputs("".join(cell["source"]), names, count)
            cells.append(cell | {"outputs": outputs, "execution_count": count})
    finally:
        os.chdir(before)
    return notebook | {"cells": cells}


def _outputs(source: str, names: dict[str, Any], count: int) -> list[dict[str, Any]]:
    """Run a cell; return what it printed, and its last expression."""
    body = ast.parse(source)
    last = body.body.pop() if body.body and isinstance(body.body[-1], ast.Expr) else None
    printed, shown = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(body, "<cell>", "exec"), names)  # noqa: S102  # our own notebook
        if isinstance(last, ast.Expr):
            shown = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)  # noqa: S307
    outputs: list[dict[str, Any]] = []
    if text := printed.getvalue():
        outputs.append({"output_type": "stream", "name": "stdout", "text": text.splitlines(keepends=True)})
    # What a file's writing returns, the number of characters, is not shown.
    if shown is not None and not isinstance(shown, int):
        outputs.append(
            {"output_type": "execute_result", "execution_count": count, "metadata": {}, "data": _data(shown)}
        )
    return outputs


def _data(shown: object) -> dict[str, list[str]]:
    if hasattr(shown, "_repr_html_"):
        return {"text/html": shown._repr_html_().splitlines(keepends=True)}
    return {"text/plain": repr(shown).splitlines(keepends=True)}


def main(names: tuple[str, ...]) -> None:
    """Run the notebooks and store their outputs."""
    for name in names or NOTEBOOKS:
        path = HERE / f"{name}.ipynb"
        with tempfile.TemporaryDirectory() as folder:
            found = executed(json.loads(path.read_text(encoding="utf-8")), Path(folder))
        path.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(tuple(sys.argv[1:]))
