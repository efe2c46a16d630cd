"""Mutation testing on a random sample: `make mutants`, or `python tests/mutation/sample.py --seed 1 --count 200`.

Cosmic Ray lists every mutation of `drivers/`, `daemon/` and `calibration/mismatch/`. Places are sampled, each with one
of its mutations; annotations and `TYPE_CHECKING` blocks are left out, as they do not run.

The rooms' fast tests run once under coverage, which says which tests execute which line. Each mutant then runs in a
copy of the checkout: first the tests that execute its line, then, where an import executes it, all tests that mirror
its folder (`drivers/can/bus.py` → `tests/drivers/can`). A test that fails is repeated alone before it counts. Tests
that need a guest kernel (`vcan`, `systemd`) are not run.

Prints each survivor as a diff, with what `survivors.toml` says of it, and writes `build/figures/mutants.json`.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
import venv
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

import coverage
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

ROOT = Path(__file__).resolve().parents[2]
SURVIVORS = Path(__file__).with_name("survivors.toml")
ROOMS = {"drivers": "tests/drivers", "daemon": "tests/daemon", "calibration/mismatch": "tests/calibration/mismatch"}
ALSO = {"daemon/demo": ("tests/system/test_demo.py",)}
"""Fast tests outside the mirrored room that exercise a folder."""
EVERYWHERE = "tests/test_dataclasses.py"
"""Rules for every file of the rooms, which no line of them executes."""
Executing = dict[str, dict[int, list[str]]]
"""For each file and line: the tests that execute it, the quickest first; "" first where an import executes it too."""
EQUAL = ("_Is_Eq", "_IsNot_NotEq")
"""Left out: `is` compares enumeration members and None here, for which `==` gives the same."""
OWN_PROCESS = ("daemon/commands/", "daemon/demo/")
"""Folders that tests run in processes of their own, of which coverage knows nothing."""
NO_TESTS = 5
"""pytest's exit status where every test is left out."""
LONGEST_S = 300.0
"""A test run that takes longer has been made to hang: the mutant is killed."""


@dataclass(frozen=True)
class Mutation:
    """One mutation: Cosmic Ray's operator, which occurrence of it in the file, and where that is."""

    file: str
    line: int
    column: int
    operator: str
    occurrence: int


@dataclass(frozen=True)
class Result:
    """What became of a mutant. `tests` execute its line; `diff` holds the changed lines."""

    file: str
    line: int
    operator: str
    tests: int
    killed: bool
    seconds: float
    diff: str


def skipped_lines(tree: ast.Module) -> set[tuple[int, int]]:
    """Return (line, column) of everything that does not run: annotations, `if TYPE_CHECKING`, docstrings."""
    parts: list[ast.AST] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            parts += [node.test, *node.body]
        if isinstance(node, ast.arg | ast.AnnAssign) and node.annotation:
            parts.append(node.annotation)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.returns:
            parts.append(node.returns)
    return {
        (line, column)
        for part in parts
        if isinstance(part, ast.expr | ast.stmt)
        for line in range(part.lineno, (part.end_lineno or part.lineno) + 1)
        for column in range(
            part.col_offset if line == part.lineno else 0,
            (part.end_col_offset or 0) if line == part.end_lineno else 400,
        )
    }


def mutations(file: str) -> Iterator[Mutation]:
    """Yield every mutation of a file, relative to the checkout, but those that make an equal program of this code."""
    source = (ROOT / file).read_text()
    skipped, tree = skipped_lines(ast.parse(source)), get_ast(source)
    for name in operator_names():
        kind = get_operator(name)
        if kind.arguments() or name.endswith(("NoOp", *EQUAL)):
            continue
        operator = kind()
        places = [start for node in ast_nodes(tree) for start, _ in operator.mutation_positions(node)]
        for occurrence, (line, column) in enumerate(places):
            if (line, column) not in skipped:
                yield Mutation(file, line, column, name, occurrence)


def sample(count: int, seed: int, only: str) -> list[Mutation]:
    """Draw places evenly over all of them, and one mutation for each."""
    listed = subprocess.run(["git", "ls-files", *ROOMS], cwd=ROOT, check=True, capture_output=True, text=True)
    files = [name for name in listed.stdout.split() if name.endswith(".py") and name.startswith(only)]
    places: dict[tuple[str, int, int], list[Mutation]] = {}
    for file in files:
        for mutation in mutations(file):
            places.setdefault((mutation.file, mutation.line, mutation.column), []).append(mutation)
    generator = random.Random(seed)
    chosen = generator.sample(sorted(places), min(count, len(places)))
    return [generator.choice(places[place]) for place in chosen]


def mirrored_tests(file: str) -> tuple[str, ...]:
    """Return the folder of tests that mirrors a file's folder, or the nearest one above it, and what belongs to it."""
    room = next(room for room in ROOMS if file.startswith(room + "/"))
    folder = Path(ROOMS[room]) / Path(file).parent.relative_to(room)
    while not (ROOT / folder).is_dir():
        folder = folder.parent
    also = tuple(path for part, paths in ALSO.items() if file.startswith(part + "/") for path in paths)
    return (EVERYWHERE, str(folder), *also)


def copy_of_checkout(folder: Path) -> Path:
    """Copy the tracked files and make an environment that imports the copy; return its Python."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True)
    for name in listed.stdout.split():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name, follow_symlinks=False)
    venv.create(folder / ".venv", with_pip=False)
    (packages,) = (folder / ".venv" / "lib").glob("python*/site-packages")
    paths = [str(folder / "src"), *(path for path in sys.path if path.endswith("site-packages"))]
    (packages / "copy.pth").write_text("\n".join(paths) + "\n")
    return folder / ".venv" / "bin" / "python"


def pytest(python: Path, folder: Path, arguments: Iterable[str], longest_s: float) -> tuple[bool, str]:
    """Run pytest in a copy; return whether all tests pass, and the output. A run that takes too long does not pass."""
    command = [str(python), "-m", "pytest", "-p", "no:cacheprovider", "--durations-min=0.05"]
    command += ["-m", "not vcan and not systemd", *arguments]
    quiet = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "OPENBLAS_NUM_THREADS": "1", "CI": "", "COLUMNS": "400"}
    try:
        done = subprocess.run(
            command, cwd=folder, env=quiet, check=False, capture_output=True, text=True, timeout=longest_s
        )
    except subprocess.TimeoutExpired:
        return False, ""
    return done.returncode in {0, NO_TESTS}, done.stdout


def failed_tests(output: str) -> list[str]:
    """Return the names of the tests that pytest's summary lists as failed."""
    return re.findall(r"^(?:FAILED|ERROR) (.+?::.+?)(?: - |$)", output, flags=re.MULTILINE)


def passes(python: Path, folder: Path, arguments: Iterable[str], longest_s: float) -> bool:
    """Run tests; a test that fails is repeated alone, so that a test that a busy machine made late does not count."""
    passed, output = pytest(python, folder, arguments, longest_s)
    failed = failed_tests(output)
    return passed or (bool(failed) and pytest(python, folder, failed, longest_s)[0])


def executing_tests(python: Path, folder: Path, files: Iterable[str]) -> Executing:
    """Run the fast tests of these files' rooms once under coverage; return the tests that execute each line."""
    rooms = {room for room in ROOMS if any(file.startswith(room + "/") for file in files)}
    tests = [*(ROOMS[room] for room in rooms), *(test for file in files for test in mirrored_tests(file)[2:])]
    tests = list(dict.fromkeys(tests))
    under_coverage = ["-p", "pytest_cov", "--cov=regolithd", "--cov-context=test", "--durations=0", "-vv", *tests]
    passed, output = pytest(python, folder, under_coverage, 3600.0)
    failed = failed_tests(output)
    if not passed and not (failed and passes(python, folder, failed, LONGEST_S)):
        sys.exit(f"the tests do not pass without a mutation\n{output[-4000:]}")
    data = coverage.CoverageData(str(folder / ".coverage"))
    data.read()
    durations_s = {name: float(took) for took, name in re.findall(r"^([\d.]+)s call +(.+)$", output, re.MULTILINE)}
    found: Executing = {}
    for measured in data.measured_files():
        file = str(Path(measured).resolve().relative_to(folder.resolve()))
        contexts = data.contexts_by_lineno(measured)
        found[file] = {
            line: sorted(
                {each.split("|")[0] for each in names}, key=lambda name: (bool(name), durations_s.get(name, 0.0))
            )
            for line, names in contexts.items()
        }
    return found


def other_than(tests: Iterable[str]) -> list[str]:
    """Return the arguments by which pytest leaves out these tests."""
    return [argument for test in tests for argument in ("--deselect", test)]


def run_mutant(mutation: Mutation, python: Path, folder: Path, executing: Executing) -> Result:
    """Put the mutation into the copy, run the tests, and take it out again."""
    original = (folder / mutation.file).read_text()
    mutated = mutate_code(original, get_operator(mutation.operator)(), mutation.occurrence)
    lines = difflib.unified_diff(original.splitlines(), mutated.splitlines(), lineterm="", n=0)
    diff = "\n".join(line for line in lines if line[:3] not in {"---", "+++"} and line[:2] != "@@")
    found = executing.get(mutation.file, {}).get(mutation.line, [""])
    tests = [name for name in found if name]
    started = time.monotonic()
    (folder / mutation.file).write_text(mutated)
    try:
        killed = bool(tests) and not passes(python, folder, ["-x", *tests], LONGEST_S)
        if not killed and ("" in found or mutation.file.startswith(OWN_PROCESS)):
            others = [*mirrored_tests(mutation.file), *other_than(tests)]
            killed = not passes(python, folder, ["-x", *others], LONGEST_S)
    finally:
        (folder / mutation.file).write_text(original)
    return Result(mutation.file, mutation.line, mutation.operator, len(tests), killed, time.monotonic() - started, diff)


def words() -> dict[tuple[str, str], str]:
    """Return what is said of known survivors, by file and diff."""
    if not SURVIVORS.exists():
        return {}
    listed: list[dict[str, Any]] = tomllib.loads(SURVIVORS.read_text()).get("survivor", [])
    return {(each["file"], each["diff"].strip()): each["word"] for each in listed}


def main() -> None:
    """Run the sample with as many workers as there are cores."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--only", default="", help="a folder, for instance drivers/can")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "figures" / "mutants.json")
    given = parser.parse_args()
    chosen, known, results = sample(given.count, given.seed, given.only), words(), []
    with tempfile.TemporaryDirectory(prefix="mutants-") as name:
        copies: SimpleQueue[tuple[Path, Path]] = SimpleQueue()
        for worker in range(given.workers):
            folder = Path(name) / str(worker)
            python = copy_of_checkout(folder)
            copies.put((python, folder))
        executing = executing_tests(python, folder, {each.file for each in chosen})

        def run(mutation: Mutation) -> Result:
            python, folder = copies.get()
            try:
                return run_mutant(mutation, python, folder, executing)
            finally:
                copies.put((python, folder))

        with ThreadPoolExecutor(given.workers) as pool:
            for result in pool.map(run, chosen):
                results.append(result)
                state = "killed  " if result.killed else "SURVIVED"
                print(f"{len(results):4d} {state} {result.seconds:5.0f} s  {result.file}:{result.line}", flush=True)
                if not result.killed:
                    print(result.diff, known.get((result.file, result.diff.strip()), ""), sep="\n", flush=True)
    report(results, known, given.seed, given.out)


def report(results: list[Result], known: dict[tuple[str, str], str], seed: int, out: Path) -> None:
    """Print the score and write the figures."""
    killed = sum(result.killed for result in results)
    survivors = [result for result in results if not result.killed]
    equal = sum(known.get((each.file, each.diff.strip()), "").startswith("equal") for each in survivors)
    figures = {
        "seed": seed,
        "mutants": len(results),
        "killed": killed,
        "equal": equal,
        "share_killed": killed / len(results),
    }
    for room in ROOMS:
        mine = [result for result in results if result.file.startswith(room + "/")]
        figures[f"share_killed_{room.replace('/', '_')}"] = sum(r.killed for r in mine) / max(len(mine), 1)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(figures, indent=1) + "\n")
    listed = [asdict(each) | {"word": known.get((each.file, each.diff.strip()), "")} for each in survivors]
    out.with_name("mutant-survivors.json").write_text(json.dumps(listed, indent=1, ensure_ascii=False) + "\n")
    print(f"{killed} of {len(results)} killed ({100 * killed / len(results):.0f} %), {equal} more are equal programs")


if __name__ == "__main__":
    main()
