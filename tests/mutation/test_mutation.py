"""What `make mutants` changes, which tests it runs, and that its copy of the checkout is left as it was."""

from __future__ import annotations

import ast
import json
import re
import signal
import subprocess
import sys
import tomllib
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from checkout import USAGE_ERROR, Checkout, Run, renew_tests
from coverage_map import CoverageMap, known_to_be_slow, merged, statement_lines
from figures import SURVIVORS, Words, line_of, score, write_page
from mutants import Mutation, left_out, mutations, sample
from sample import place_of, read_results
from trial import Result, selected_tests

ROOT = Path(__file__).resolve().parents[2]
FILE = "drivers/can/limits.py"
SOURCE = '''"""Limits."""

if TYPE_CHECKING:
    from collections.abc import Sequence

SEND_TIMEOUT_S = 3.0
FRAMES = 7


def within(count: int, timeout_s: float = 2.0, *, most: int = FRAMES) -> bool | None:
    """Return whether there are not too many."""
    return (
        count < most
        and timeout_s > 1
    )
'''
KILLED = Result(
    FILE, 7, 9, "core/NumberReplacer", "killed", 3, "tests/drivers/can/test_limits.py::test_most", 1.0, "+ 8"
)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A checkout with one file of drivers and its tests."""
    (tmp_path / "drivers/can").mkdir(parents=True)
    (tmp_path / "tests/drivers/can").mkdir(parents=True)
    (tmp_path / FILE).write_text(SOURCE)
    return tmp_path


def test_time_limits_and_annotations_are_left_out(root: Path) -> None:
    """The constant, the parameter's default, and types; numbers that decide something are mutated."""
    lines = {each.line for each in mutations(root, FILE)}
    assert lines == {7, 13, 14}
    columns = {column for line, column in left_out(ast.parse(SOURCE)) if line == 10}
    assert SOURCE.splitlines()[9].index("2.0") in columns
    assert SOURCE.splitlines()[9].index("FRAMES") not in columns


def test_every_mutant_is_a_program(root: Path) -> None:
    """A `*` or `**` that is no operator is left out; a real one is mutated."""
    text = "def f(*a: int, **b: int) -> object:\n    return g(*a, **b), [*a], {**b}, 2 * 3**4\n"
    (root / FILE).write_text(text)
    made = list(mutations(root, FILE))
    assert {text.splitlines()[each.line - 1][each.column :][:2] for each in made if "Binary" in each.operator} == {
        "* ",
        "**",
    }
    for each in made:
        compile(each.applied(text), FILE, "exec")


def test_a_larger_sample_begins_with_the_smaller_one(root: Path) -> None:
    """The order depends on the seed alone."""
    assert sample(root, 4, 1, "")[:2] == sample(root, 2, 1, "")
    assert [each.column for each in sample(root, 9, 1, "")] != [each.column for each in sample(root, 9, 2, "")]
    assert sample(root, 9, 1, "daemon") == []


def test_a_mutation_is_one_change(root: Path) -> None:
    """The occurrence that it names."""
    mutated = Mutation(FILE, 7, 9, "core/NumberReplacer", 0).applied("FRAMES = 7\nMORE = 7\n")
    assert mutated in {"FRAMES = 8\nMORE = 7\n", "FRAMES = 6\nMORE = 7\n"}
    assert root.is_dir()


def test_a_line_belongs_to_the_lines_of_its_statement() -> None:
    """Coverage names only some lines of a statement; of a function the head counts, not the body."""
    assert statement_lines(SOURCE, 14) == range(12, 16)
    assert statement_lines(SOURCE, 10) == range(10, 11)
    assert statement_lines(SOURCE, 7) == range(7, 8)


def test_tests_of_the_line_run_the_nearest_and_quickest_first(root: Path) -> None:
    """The module's own test file first; where an import executes the line, those of its file and folder run as well."""
    far, slow, quick, other = (
        "tests/drivers/master/test_boot.py::test_far",
        "tests/drivers/can/test_limits.py::test_slow",
        "tests/drivers/can/test_limits.py::test_quick",
        "tests/drivers/can/test_bus.py::test_other",
    )
    lines = {"7": [""], "13": [far, quick, slow], "10": ["", far]}
    found = CoverageMap({far: 0.1, slow: 2.0, quick: 1.0, other: 0.05}, {FILE: lines})
    within, constant = Mutation(FILE, 13, 14, "", 0), Mutation(FILE, 7, 9, "", 0)
    assert selected_tests(within, root, found) == [quick, slow, far]
    assert selected_tests(constant, root, found) == [quick, slow, other, far]
    long = replace(found, seconds={far: 0.1, slow: 2.0, quick: 100.0, other: 3.0})
    assert selected_tests(within, root, long) == [slow, quick]


@pytest.mark.parametrize(
    ("run", "exceeded", "timed_out"),
    [
        (Run(-signal.SIGXCPU, ""), True, False),
        (Run(-signal.SIGKILL, "", ended=True), False, True),
        (Run(1, "FAILED tests/a.py::test_b - Failed: Timeout (>60.0s)"), False, True),
        (Run(1, "FAILED tests/a.py::test_b - assert 1 == 2"), False, False),
    ],
)
def test_a_run_says_why_it_failed(run: Run, exceeded: bool, timed_out: bool) -> None:
    """CPU time is the mutant's own; time on the clock may be the machine's."""
    assert (run.passed, run.cpu_exceeded, run.timed_out) == (False, exceeded, timed_out)


def test_the_failed_tests_are_read_from_the_summary() -> None:
    """Also where a parameter has spaces and a message follows."""
    output = (
        "FAILED tests/a.py::test_b[x y] - assert 1 == 2\nERROR tests/c.py::test_d\nERROR tests/e.py - ImportError\n"
    )
    assert Run(1, output).failed == ("tests/a.py::test_b[x y]", "tests/c.py::test_d")


def test_a_killed_run_leaves_no_mutant_behind(root: Path) -> None:
    """The next one restores text and time, by which Python knows that its compiled form is valid."""
    before = (root / FILE).stat().st_mtime_ns
    checkout = Checkout(root)
    entered = checkout.changed(FILE, "FRAMES = 8\n")
    entered.__enter__()
    assert (root / FILE).read_text() == "FRAMES = 8\n"
    Checkout(root).restore()
    assert (root / FILE).read_text() == SOURCE
    assert (root / FILE).stat().st_mtime_ns == before


def test_each_run_imports_anew_and_has_its_own_limits(root: Path) -> None:
    """A fork of one process knows what a file holds now, what failed, and when a test computes for too long."""
    (root / ".venv").symlink_to(sys.prefix)
    (root / "value.py").write_text("VALUE = 1\n")
    (root / "test_value.py").write_text(
        "import os\nfrom value import VALUE\n\n"
        "def test_one():\n    assert VALUE == 1 and os.environ['GIVEN'] == 'yes'\n\n"
        "def test_long():\n    while VALUE:\n        pass\n"
    )
    checkout, given = Checkout(root), {"GIVEN": "yes", "PYTHONDONTWRITEBYTECODE": "1"}
    assert checkout.pytest(["test_value.py::test_one"], 60, given).passed
    with checkout.changed("value.py", "VALUE = 0\n"):
        failed = checkout.pytest(["test_value.py"], 60, given)
    assert (failed.passed, failed.failed) == (False, ("test_value.py::test_one",))
    endless = checkout.pytest(["test_value.py::test_long"], 2, given)
    assert (endless.passed, endless.cpu_exceeded, endless.timed_out) == (False, True, False)
    assert checkout.pytest(["test_value.py::test_one"], 60, given).passed
    assert checkout.pytest(["test_value.py::test_none"], 60, given).status == USAGE_ERROR


def test_the_page_tells_seed_share_and_words(tmp_path: Path) -> None:
    """Survivors have a word; the share is of all mutants."""
    lived = replace(KILLED, verdict="survived", file="daemon/a.py", diff="+ 9")
    words = Words({("daemon/a.py", "+ 9"): "equal: the same"})
    figures = score([KILLED, KILLED, KILLED, lived], 7, words)
    assert line_of(figures) == (
        "Seed 7: 3 of 4 mutants killed (75 %; mutation score 100 %), 3 (75 %) with the tests that were added for "
        "survivors since; 1 are equal programs."
    )
    write_page(figures, 6.0, tmp_path / "page.md")
    page = (tmp_path / "page.md").read_text()
    assert line_of(figures) in page
    assert "| `drivers/` | 3 | 3 | 3 |" in page
    assert "| `daemon/` | 1 | 0 | 0 |" in page
    assert "before it" not in page


def test_a_survivor_that_was_tried_again_counts_by_what_was_found() -> None:
    """Not by its word, which may be wrong."""
    lived = [replace(KILLED, verdict="survived", file=f"daemon/{name}.py") for name in "ab"]
    words = Words({(each.file, each.diff): "test: tests/daemon/test_a.py::test_a" for each in lived})
    assert score([KILLED, *lived], 7, words)["test_added"] == 2
    tried = score([KILLED, *lived], 7, words, noticed=lived[:1])
    assert (tried["killed"], tried["test_added"]) == (1, 1)
    assert tried["rooms"]["daemon"] == {"mutants": 2, "killed": 0, "since": 1}


def test_the_last_result_of_a_mutant_counts(tmp_path: Path) -> None:
    """One that was tried again has several; another place is another mutant."""
    rows = [replace(KILLED, verdict="survived"), replace(KILLED, column=3), KILLED]
    (tmp_path / "log").write_text("".join(json.dumps(asdict(row)) + "\n" for row in rows))
    assert [each.verdict for each in read_results(tmp_path / "log").values()] == ["killed", "killed"]
    assert set(read_results(tmp_path / "log")) == {place_of(KILLED), place_of(rows[1])}


def test_renewed_test_files_take_the_place_of_what_was_known_of_them() -> None:
    """A test that is gone covers nothing; new ones are added, and those of other files stay."""
    stays, gone, new = "tests/a/test_x.py::test_1", "tests/a/test_y.py::test_2", "tests/a/test_y.py::test_3"
    before = CoverageMap({stays: 1.0, gone: 2.0}, {"a.py": {"1": ["", stays], "2": [gone]}})
    after = CoverageMap({new: 3.0}, {"a.py": {"1": ["", new], "4": [new]}})
    found = merged(before, after, ["tests/a/test_y.py"])
    assert found.seconds == {stays: 1.0, new: 3.0}
    assert found.lines == {"a.py": {"1": ["", stays, new], "2": [], "4": [new]}}


def test_only_the_tests_of_a_copy_are_renewed(tmp_path: Path) -> None:
    """The code stays that of the mutants that were drawn."""
    source, copy = tmp_path / "source", tmp_path / "copy"
    for folder, text in ((source, "new"), (copy, "old")):
        for name in ("code.py", "tests/test_changed.py", "tests/test_same.py"):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text("same" if "same" in name else text)
    (source / "tests/test_added.py").write_text("new")
    for line in (["git", "init", "-q"], ["git", "add", "."]):
        subprocess.run(line, cwd=source, check=True)
    assert renew_tests(source, Checkout(copy)) == ["tests/test_added.py", "tests/test_changed.py"]
    assert [(copy / name).read_text() for name in ("code.py", "tests/test_changed.py")] == ["old", "new"]
    assert renew_tests(source, Checkout(copy)) == []


def test_the_page_keeps_what_it_says_of_earlier_samples(tmp_path: Path) -> None:
    """The newest first; a sample that is drawn again replaces its own line."""
    path = tmp_path / "page.md"
    for seed, results in ((7, [KILLED]), (8, [KILLED] * 2), (9, [KILLED] * 3), (8, [KILLED] * 4)):
        write_page(score(results, seed, Words({})), 6.0, path)
    lines = [line[:27] for line in path.read_text().splitlines() if "Seed" in line]
    assert lines == ["Seed 8: 4 of 4 mutants kill", "- Seed 9: 3 of 3 mutants ki", "- Seed 7: 1 of 1 mutants ki"]


@pytest.mark.parametrize("survivor", tomllib.loads(SURVIVORS.read_text())["survivor"], ids=lambda each: each["file"])
def test_every_survivor_is_equal_or_has_a_test(survivor: dict[str, str]) -> None:
    """There is no third word; a test that is named exists."""
    kind, _, rest = survivor["word"].partition(": ")
    assert kind in {"equal", "test"}
    assert rest
    if kind == "test":
        path, _, name = rest.partition("::")
        assert f"def {name.partition('[')[0]}(" in (ROOT / path).read_text()


def test_every_mutant_of_the_page_is_killed_noticed_now_or_equal() -> None:
    """The page is of a sample whose survivors all have a word."""
    page = (ROOT / "docs/explanation/mutation-testing.md").read_text(encoding="utf-8")
    told = re.search(r"(\d+) of (\d+) mutants killed \(\d+ %[^)]*\), (\d+) \(\d+ %\) with .*?; (\d+) are equal", page)
    assert told
    killed, mutants, since, equal = map(int, told.groups())
    assert killed <= since
    assert since + equal == mutants
    rows = re.findall(r"^\| `[a-z/]+` \| (\d+) \| (\d+) \| (\d+) \|$", page, flags=re.MULTILINE)
    assert [sum(int(row[column]) for row in rows) for column in range(3)] == [mutants, killed, since]


def test_only_tests_that_took_too_long_are_left_out_in_the_next_sample(tmp_path: Path) -> None:
    """A test that failed under another seed is run again."""
    rows = [
        {"test": "quick", "fast": True, "cpu_s": 0.1, "clock_s": 0.2},
        {"test": "failed", "fast": False, "cpu_s": 0.1, "clock_s": 0.2},
        {"test": "computes", "fast": False, "cpu_s": 6.1, "clock_s": 7.0},
        {"test": "waits", "fast": False, "cpu_s": 0.1, "clock_s": 61.0},
    ]
    (tmp_path / "seed-1").mkdir()
    (tmp_path / "seed-1" / "daemon.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    assert known_to_be_slow(tmp_path / "seed-2" / "daemon.json") == {"computes", "waits"}
