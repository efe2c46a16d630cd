"""The notebooks run from the first cell to the last, and print what is stored in them."""

from __future__ import annotations

import json
import os
import runpy
import shutil
from pathlib import Path
from typing import Any

import pytest

NOTEBOOKS = Path(__file__).resolve().parents[2] / "docs" / "notebooks"
EXECUTE = runpy.run_path(str(NOTEBOOKS / "execute.py"))


def printed(notebook: dict[str, Any]) -> list[str]:
    """Return what each cell printed or showed as text."""
    found = []
    for cell in notebook["cells"]:
        for output in cell.get("outputs", []):
            text = output.get("text") or output["data"].get("text/plain", ["a report"])
            found.append("".join(text))
    return found


@pytest.mark.timeout(300)
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("name", EXECUTE["NOTEBOOKS"])
def test_a_notebook_prints_what_is_stored_in_it(name: str, tmp_path: Path) -> None:
    """`python docs/notebooks/execute.py NAME` renews it, where a change is wanted."""
    if name == "fmu" and not shutil.which(os.environ.get("CC", "cc")):
        pytest.skip("no C compiler for the FMU: apt-get install gcc")
    stored = json.loads((NOTEBOOKS / f"{name}.ipynb").read_text(encoding="utf-8"))
    found = EXECUTE["executed"](stored, tmp_path)
    assert printed(found) == printed(stored)
    assert "a report" in printed(found)


@pytest.mark.parametrize("name", EXECUTE["NOTEBOOKS"])
def test_a_notebook_follows_the_format_of_jupyter(name: str) -> None:
    """Any program that reads notebooks can open it."""
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed: pip install nbformat")
    nbformat.validate(nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4))
