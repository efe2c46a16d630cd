"""Try one mutant: put it into the copy, run the fast tests that may notice it, take it out again."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from checkout import USAGE_ERROR
from coverage_map import AT_IMPORT, statement_lines
from mutants import ROOMS, difference, room_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from checkout import Checkout, Run
    from coverage_map import CoverageMap
    from mutants import Mutation

Verdict = Literal["killed", "survived", "undecided"]

LONGEST_S = 60.0
"""Time of the tests of one mutant, as measured without it: the nearest and quickest of them."""
STARTING_CPU_S, SLOWER = 60, 5.0
"""Limit of CPU time: so much, and so many times what the tests took without the mutant."""
TEST_TIMEOUT_S = 60
"""Time on the clock for one fast test: one that waits for what never comes uses no CPU time."""
ONLY_COMPUTES = "calibration/mismatch"
"""The room whose tests wait for nothing, so that a busy machine makes none of them fail."""
REPETITIONS = 4
"""Runs at most of the tests of one mutant, each without those that a busy machine made late before."""
OF_DECORATORS = ("tests/test_dataclasses.py",)
"""Rules for the dataclasses of every file of the rooms, which no line of them executes."""
ALSO = {"daemon/demo/": ("tests/system/test_demo.py",)}
"""Fast tests outside the mirrored room that exercise a folder."""
OWN_PROCESS = ("daemon/commands/", "daemon/demo/")
"""Folders that tests run in processes of their own, of which coverage knows nothing."""


@dataclass(frozen=True)
class Result:
    """What became of a mutant: `tests` were run, `diff` holds the changed lines."""

    file: str
    line: int
    column: int
    operator: str
    verdict: Verdict
    tests: int
    noticed_by: str
    seconds: float
    diff: str


def mirrored_folder(root: Path, file: str) -> str:
    """Return the folder of tests that mirrors a file's folder, or the nearest one above it."""
    room = room_of(file)
    folder = Path(ROOMS[room]) / Path(file).parent.relative_to(room)
    while not (root / folder).is_dir():
        folder = folder.parent
    return str(folder)


def selected_tests(mutation: Mutation, root: Path, found: CoverageMap) -> list[str]:
    """Return the fast tests to run: those that execute the line; where an import does, also those of file and folder.

    Those of the module's own test file go first, then those of the mirrored folder, then the quickest.
    """
    lines = statement_lines((root / mutation.file).read_text(), mutation.line)
    names = found.of_lines(mutation.file, lines)
    folder = mirrored_folder(root, mutation.file) + "/"
    if not names or AT_IMPORT in names or mutation.file.startswith(OWN_PROCESS):
        names |= found.of_file(mutation.file) | {test for test in found.seconds if test.startswith(folder)}
    names.discard(AT_IMPORT)
    own = own_file(mutation)
    ordered = sorted(names, key=lambda test: (own not in test, not test.startswith(folder), found.seconds[test]))
    kept: list[str] = []
    for test in ordered:
        if sum(found.seconds[each] for each in kept) < LONGEST_S:
            kept.append(test)
    return kept


def own_file(mutation: Mutation) -> str:
    """Return what the names of the tests in the module's own file contain."""
    return f"/test_{Path(mutation.file).stem}.py::"


def outside_the_room(mutation: Mutation, original: str) -> tuple[str, ...]:
    """Return further tests, by what is changed and in which file."""
    of_decorators = OF_DECORATORS if original.splitlines()[mutation.line - 1].lstrip().startswith("@") else ()
    return (*of_decorators, *(path for part, paths in ALSO.items() if mutation.file.startswith(part) for path in paths))


def try_mutant(mutation: Mutation, checkout: Checkout, found: CoverageMap, *, confirmed: bool = False) -> Result:
    """Run the tests for a mutant in the copy.

    `confirmed`: tests that fail have to pass without the mutant; else that is asked only where they waited too long.
    """
    original = (checkout.root / mutation.file).read_text()
    mutated = mutation.applied(original)
    tests = selected_tests(mutation, checkout.root, found)
    nearest = [test for test in tests if own_file(mutation) in test]
    batches = (nearest, [*outside_the_room(mutation, original), *(test for test in tests if test not in nearest)])
    cpu_s = STARTING_CPU_S + math.ceil(SLOWER * sum(found.seconds[test] for test in tests))
    started = time.monotonic()
    with checkout.changed(mutation.file, mutated):
        run, failed = _failing_run(checkout, batches, cpu_s, repeated=room_of(mutation.file) != ONLY_COMPUTES)
    verdict: Verdict = "survived" if run is None else "killed"
    if run is not None and (confirmed or run.timed_out) and not _run(checkout, failed, cpu_s).passed:
        verdict = "undecided"
    return Result(
        file=mutation.file,
        line=mutation.line,
        column=mutation.column,
        operator=mutation.operator,
        verdict=verdict,
        tests=len(tests),
        noticed_by=failed[0] if failed else "",
        seconds=round(time.monotonic() - started, 1),
        diff=difference(original, mutated),
    )


def _failing_run(
    checkout: Checkout, batches: Iterable[Sequence[str]], cpu_s: int, *, repeated: bool
) -> tuple[Run | None, Sequence[str]]:
    """Return the first run that failed, and its tests; None where all pass.

    The nearest tests are a batch of their own: to collect the others often takes longer than they run.
    """
    for tests in filter(None, batches):
        run, failed = _failing_batch(checkout, tests, cpu_s, repeated=repeated)
        if run is not None:
            return run, failed
    return None, ()


def _failing_batch(
    checkout: Checkout, tests: Sequence[str], cpu_s: int, *, repeated: bool
) -> tuple[Run | None, Sequence[str]]:
    """Return the run that failed, and its tests; None where all pass.

    A test that fails is `repeated` alone: what a busy machine made late then passes, and the others are run without it.
    """
    late: list[str] = []
    for _ in range(REPETITIONS):
        run = _run(checkout, [*tests, *(f"--deselect={test}" for test in late)], cpu_s)
        if run.passed:
            return None, ()
        failed = run.failed or tests
        if run.cpu_exceeded or run.timed_out or not repeated:
            return run, failed
        again = _run(checkout, failed, cpu_s)
        if not again.passed:
            return again, failed
        late += failed
    return None, ()


def _run(checkout: Checkout, arguments: Iterable[str], cpu_s: int) -> Run:
    """Run tests without writing compiled files; where a mutant has renamed one, the files that they are in."""
    settings, stopping = {"PYTHONDONTWRITEBYTECODE": "1"}, ["-x", f"--timeout={TEST_TIMEOUT_S}"]
    run = checkout.pytest([*stopping, *arguments], cpu_s, settings)
    if run.status == USAGE_ERROR:
        files = {argument.partition("::")[0] for argument in arguments if not argument.startswith("-")}
        run = checkout.pytest([*stopping, *sorted(files)], cpu_s, settings)
    return run
