"""The house's own rules: lint, types, which room may know which, what a rover's computer must load."""

from __future__ import annotations

import ast
import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ROOMS = ("daemon", "drivers", "calibration")
LAPTOP_ONLY = {"jax", "jaxlib", "matplotlib", "onnx", "optax", "pandas", "pyarrow", "scipy", "sklearn"}
SAYS_NOTHING = {"utils", "util", "helpers", "helper", "common", "base", "manager", "misc"}


def run(*command: str) -> subprocess.CompletedProcess[str]:
    """Run a command of this interpreter's environment at the top of the project."""
    return subprocess.run([sys.executable, *command], cwd=ROOT, check=False, capture_output=True, text=True)


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    "command",
    [
        ("-m", "ruff", "check", "--quiet"),
        ("-m", "ruff", "format", "--check", "--quiet"),
        ("-m", "mypy", "--no-error-summary"),
        ("-c", "from importlinter.cli import lint_imports_command; lint_imports_command()", "--no-cache"),
    ],
    ids=["ruff", "format", "mypy", "imports"],
)
def test_a_checker_finds_nothing(command: tuple[str, ...]) -> None:
    """Each checker that `make check` runs is silent."""
    done = run(*command)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_rover_loads_nothing_of_the_laptop() -> None:
    """Neither the command line nor the service imports what only fits, trains or draws."""
    wanted = [name for name in ("regolithd.daemon.cli", "regolithd.daemon.service") if importlib.util.find_spec(name)]
    done = run("-c", f"import sys, {', '.join(wanted)}; print(*{{name.split('.')[0] for name in sys.modules}})")
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.split())
    assert "regolithd" in loaded
    assert not loaded & LAPTOP_ONLY


def test_every_test_says_what_must_hold() -> None:
    """Each test has a docstring of one sentence."""
    silent = []
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name.startswith("test_"):
                said = ast.get_docstring(node) or ""
                if not said.endswith(".") or re.search(r"[.!?]\s+[A-Z]", said):
                    silent.append(f"{path.relative_to(ROOT)}:{node.lineno} {node.name}")
    assert not silent, "no docstring of one sentence:\n" + "\n".join(silent)


def test_file_names_say_what_is_inside() -> None:
    """No module is called after nothing in particular."""
    named = [path for room in ROOMS for path in (ROOT / room).rglob("*.py") if path.stem in SAYS_NOTHING]
    assert not named


def test_nothing_committed_names_one_machine() -> None:
    """No file of the project holds a path of the machine that it was written on."""
    rooms = (*ROOMS, "tests", "docs", "systemd", ".ci")
    paths = [
        path
        for room in rooms
        for path in (ROOT / room).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    ]
    paths += [path for path in ROOT.iterdir() if path.is_file() and path.name != ".git"]
    homes = re.compile(rb"(^|[\s\"'=(])/(work|home/\w+|root)/\w")
    found = [str(path.relative_to(ROOT)) for path in paths if homes.search(path.read_bytes())]
    assert not found
