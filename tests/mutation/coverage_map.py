"""Which fast tests execute which line: each room's tests run once under coverage, and the result is kept."""

from __future__ import annotations

import ast
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import coverage
from fast_tests import FAST_S, LONGEST_CLOCK_S, WRITTEN_TO
from mutants import ROOMS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from checkout import Checkout

LONGEST_CPU_S = 3600
"""CPU time of a room's tests under coverage."""
FEWEST_FAST = 0.5
"""Share of a room's tests that have to pass and be fast; otherwise something is wrong with the machine."""
ENDED_BY_ITSELF = frozenset({0, 1})
"""pytest's exit statuses after it has run every test: all pass, or some fail."""
AT_IMPORT = ""
"""Coverage's context of lines that an import executes."""


@dataclass(frozen=True)
class CoverageMap:
    """The fast tests of a room: what each costs, and the lines of each file that each executes."""

    seconds: Mapping[str, float]
    lines: Mapping[str, Mapping[str, list[str]]]

    def of_lines(self, file: str, lines: range) -> set[str]:
        """Return the tests that execute one of the lines; `AT_IMPORT` among them where an import does."""
        found = self.lines.get(file, {})
        return {test for line in lines for test in found.get(str(line), ())}

    def of_file(self, file: str) -> set[str]:
        """Return the tests that execute anything of a file but its import."""
        return {test for tests in self.lines.get(file, {}).values() for test in tests if test}


def coverage_map(checkout: Checkout, room: str, kept: Path) -> CoverageMap:
    """Return a room's map, from `kept` where it was written before."""
    if not kept.exists():
        times = kept.with_suffix(".jsonl")
        kept.write_text(json.dumps(asdict(_measured(checkout, room, times, [ROOMS[room]], known_to_be_slow(kept)))))
    return CoverageMap(**json.loads(kept.read_text()))


def renew(checkout: Checkout, room: str, kept: Path, files: Sequence[str]) -> None:
    """Measure some of a room's test files anew, which were changed or added, and keep the map with them."""
    before = CoverageMap(**json.loads(kept.read_text()))
    after = _measured(checkout, room, kept.with_name(f"{kept.stem}-renewed.jsonl"), files, known_to_be_slow(kept))
    kept.write_text(json.dumps(asdict(merged(before, after, files))))


def merged(before: CoverageMap, after: CoverageMap, files: Sequence[str]) -> CoverageMap:
    """Return a map in which the tests of some files are those of another map."""

    def stays(test: str) -> bool:
        return test.partition("::")[0] not in files

    lines = {
        file: {
            line: sorted(
                {*filter(stays, before.lines.get(file, {}).get(line, ())), *after.lines.get(file, {}).get(line, ())}
            )
            for line in {**before.lines.get(file, {}), **after.lines.get(file, {})}
        }
        for file in {**before.lines, **after.lines}
    }
    return CoverageMap({test: s for test, s in before.seconds.items() if stays(test)} | dict(after.seconds), lines)


def _measured(checkout: Checkout, room: str, times: Path, tests: Sequence[str], known_slow: set[str]) -> CoverageMap:
    """Run tests of a room under coverage."""
    times.unlink(missing_ok=True)
    data_file = checkout.root / f".coverage.{room.replace('/', '-')}"
    package = f"regolithd.{room.replace('/', '.')}"
    under_coverage = ["-p", "fast_tests", f"--cov={package}", "--cov-context=test", "--cov-report=", "--timeout=0"]
    settings = {
        WRITTEN_TO: str(times),
        "PYTHONPATH": str(Path(__file__).parent),
        "COVERAGE_FILE": str(data_file),
        "COVERAGE_CORE": "ctrace",
    }
    slow = [f"--deselect={test}" for test in known_slow]
    run = checkout.pytest([*under_coverage, *slow, *tests], LONGEST_CPU_S, settings)
    if run.status not in ENDED_BY_ITSELF:
        raise SystemExit(f"the tests of {room} ended early, with status {run.status}\n{run.output[-4000:]}")
    rows = [json.loads(line) for line in times.read_text().splitlines()]
    seconds = {row["test"]: row["clock_s"] for row in rows if row["fast"]}
    if len(seconds) < FEWEST_FAST * len(rows) or not rows:
        raise SystemExit(f"{len(seconds)} of {len(rows)} tests of {room} pass and are fast\n{run.output[-4000:]}")
    print(f"{room}: {len(seconds)} of {len(rows)} tests are fast and pass", flush=True)
    return CoverageMap(seconds, _lines(data_file, checkout.root.resolve(), set(seconds)))


def known_to_be_slow(kept: Path) -> set[str]:
    """Return the tests of a room that took too long under any seed: to find that out again is half of the time.

    A test that failed there may pass now.
    """
    rows = (
        json.loads(line)
        for path in kept.parent.parent.glob(f"*/{kept.stem}.jsonl")
        for line in path.read_text().splitlines()
    )
    return {row["test"] for row in rows if row["cpu_s"] >= FAST_S or row["clock_s"] >= LONGEST_CLOCK_S}


def _lines(data_file: Path, root: Path, fast: set[str]) -> dict[str, dict[str, list[str]]]:
    """Return, for each file of the checkout and each line, the fast tests that execute it."""
    data = coverage.CoverageData(str(data_file))
    data.read()
    files = {measured: Path(measured).resolve() for measured in data.measured_files()}
    return {
        str(file.relative_to(root)): {
            str(line): sorted({name for name in map(_test_of, contexts) if name in fast or name == AT_IMPORT})
            for line, contexts in data.contexts_by_lineno(measured).items()
        }
        for measured, file in files.items()
        if file.is_relative_to(root)  # not a user's module that a test has written
    }


def _test_of(context: str) -> str:
    """Return the test of a coverage context, `tests/…::test_name|run`."""
    return context.rpartition("|")[0]


def statement_lines(source: str, line: int) -> range:
    """Return the lines of the smallest statement that a line is in; of a compound one, its head."""
    found = range(line, line + 1)
    size = 10**6
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or 0):
            body = getattr(node, "body", None)
            last = body[0].lineno - 1 if isinstance(body, list) and body else node.end_lineno or line
            here = range(node.lineno, max(last, node.lineno) + 1)
            if line in here and len(here) <= size:
                found, size = here, len(here)
    return found
