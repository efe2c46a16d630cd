"""Rules for the whole source tree: lint, types, imports, sizes, names, and what the rover's computer loads."""

from __future__ import annotations

import ast
import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).resolve().parent.parent
ROOMS = ("daemon", "drivers", "calibration")
MOST_LINES = 400
MOST_LOOSE_FILES = 8
LAPTOP_ONLY = {"jax", "jaxlib", "matplotlib", "onnx", "optax", "pandas", "pyarrow", "scipy", "sklearn"}
MEANINGLESS_NAMES = {"utils", "util", "helpers", "helper", "common", "base", "manager", "misc"}


def run(*command: str) -> subprocess.CompletedProcess[str]:
    """Run a Python command at the top of the project."""
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
    """Each checker that `make check` runs reports nothing."""
    done = run(*command)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_daemon_imports_no_laptop_library() -> None:
    """Neither the command line nor the service imports a library that only the laptop needs."""
    wanted = [name for name in ("regolithd.daemon.cli", "regolithd.daemon.service") if importlib.util.find_spec(name)]
    done = run("-c", f"import sys, {', '.join(wanted)}; print(*{{name.split('.')[0] for name in sys.modules}})")
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.split())
    assert "regolithd" in loaded
    assert not loaded & LAPTOP_ONLY


def test_every_test_has_a_docstring_of_one_sentence() -> None:
    """Each test's docstring is one sentence that ends in a full stop."""
    wrong = []
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name.startswith("test_"):
                text = ast.get_docstring(node) or ""
                if not text.endswith(".") or re.search(r"[.!?]\s+[A-Z]", text):
                    wrong.append(f"{path.relative_to(ROOT)}:{node.lineno} {node.name}")
    assert not wrong, "no docstring of one sentence:\n" + "\n".join(wrong)


def python_files() -> list[Path]:
    """Return the paths of all Python files: rooms, import package, tests, examples; relative to the top."""
    folders = (*(ROOT / room for room in ROOMS), ROOT / "src/regolithd", ROOT / "tests", ROOT / "docs")
    return sorted(path.relative_to(ROOT) for folder in folders for path in folder.rglob("*.py"))


def test_there_is_no_import_circle() -> None:
    """No module imports itself through others, imports for type checking and inside functions included."""
    graph = grimp.build_graph("regolithd", include_external_packages=False, cache_dir=None)
    imported = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    reached = {module: reachable(module, imported) for module in imported}
    circles = {
        frozenset(other for other in reached[module] if module in reached[other])
        for module in imported
        if module in reached[module]
    }
    assert not circles, "\n".join("import circle: " + ", ".join(sorted(circle)) for circle in circles)


def reachable(start: str, imported: dict[str, set[str]]) -> set[str]:
    """Return all modules that `start` imports, directly or through others."""
    found: set[str] = set()
    waiting = [start]
    while waiting:
        new = imported[waiting.pop()] - found
        found |= new
        waiting.extend(new)
    return found


def test_no_file_is_too_long() -> None:
    """No Python file has more than 400 lines."""
    lines = {path: len((ROOT / path).read_text(encoding="utf-8").splitlines()) for path in python_files()}
    assert {path: count for path, count in lines.items() if count > MOST_LINES} == {}


def test_few_files_lie_beside_folders() -> None:
    """A folder with sub-folders has at most eight Python files of its own, `__init__.py` not counted."""
    files = python_files()
    parents = {folder for path in files for folder in path.parent.parents}
    loose = {
        folder: sorted(path.name for path in files if path.parent == folder and path.name != "__init__.py")
        for folder in parents
    }
    assert {folder: names for folder, names in loose.items() if len(names) > MOST_LOOSE_FILES} == {}


def test_every_module_has_a_docstring() -> None:
    """Each Python file begins with a docstring."""
    assert [path for path in python_files() if not ast.get_docstring(ast.parse((ROOT / path).read_text()))] == []


def test_tests_mirror_the_source_folders() -> None:
    """Each folder of tests below a room has the name of a source folder, `tests/drivers/can` that of `drivers/can`."""
    tests = [path.relative_to("tests") for path in python_files() if path.parts[0] == "tests"]
    folders = {path.parent for path in tests if path.name.startswith("test_")}
    of_rooms = {folder for folder in folders if folder.parts and folder.parts[0] in ROOMS}
    assert {folder for folder in of_rooms if not (ROOT / folder).is_dir()} == set()


def test_file_names_say_what_is_inside() -> None:
    """No module has a name without meaning, such as `utils`."""
    named = [path for room in ROOMS for path in (ROOT / room).rglob("*.py") if path.stem in MEANINGLESS_NAMES]
    assert not named


def test_nothing_committed_names_one_machine() -> None:
    """No file of the project contains a path of the machine on which it was written."""
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
