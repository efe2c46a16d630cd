"""The page that walks the data through the code names files that exist, in an order that imports connect."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/explanation/data-flow.md").read_text(encoding="utf-8")
STEP = re.compile(r"^(\d+)\. `([^`]+)`", flags=re.MULTILINE)
COUNT = re.compile(r"^(\d+) files; (\d+) in version 0\.1\.0", flags=re.MULTILINE)
WALKS = {section.splitlines()[0]: section for section in PAGE.split("\n## ")[1:]}
IN_0_1_0 = {
    "A CAN frame becomes an MQTT message": """
        drivers/socketcan drivers/kernel_batch drivers/bus drivers/network drivers/decode daemon/service daemon/replay
        daemon/acquire daemon/pipeline calibration/drivetrain daemon/slip daemon/smooth daemon/estimate
        daemon/publish/outlet daemon/publish/publisher daemon/publish/encode daemon/publish/outbox daemon/publish/spool
        daemon/publish/segment daemon/publish/link
    """,
    "A CSV row becomes an answer": """
        daemon/commands/mismatch calibration/mismatch/simulation calibration/mismatch/recording
        calibration/mismatch/compare calibration/mismatch/scene calibration/mismatch/noise
        calibration/mismatch/dictionary calibration/mismatch/fill calibration/mismatch/search
        calibration/mismatch/decide calibration/mismatch/held_out calibration/mismatch/intervals
        calibration/mismatch/statements calibration/mismatch/rivals calibration/mismatch/sensitivity
        calibration/mismatch/answer
    """,
    "A key in rover.toml becomes a behaviour": """
        daemon/commands/run daemon/start_up daemon/config_reader daemon/config daemon/service daemon/replay
        daemon/pipeline daemon/smooth
    """,
}
"""The same walks by the same rule in version 0.1.0 (commit c69d7bb)."""


ONLY_DEFINE = {"calibration/mismatch/errors.py"}
"""Files of errors, which the data do not pass."""


def imported(path: str, *, at_run_time: bool = False) -> set[str]:
    """Files of the project that a file imports, wherever in it; or only those that are not imported for types alone."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    if at_run_time:
        tree.body = [node for node in tree.body if not isinstance(node, ast.If)]
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("regolithd."):
            place = node.module.removeprefix("regolithd.").replace(".", "/")
            found |= {f"{place}.py", *(f"{place}/{name.name}.py" for name in node.names)}
    return found


@pytest.mark.parametrize("walk", IN_0_1_0)
def test_every_step_is_a_file(walk: str) -> None:
    """The steps of a walk are numbered, and each is a file."""
    steps = STEP.findall(WALKS[walk])
    assert [int(number) for number, _ in steps] == list(range(1, len(steps) + 1))
    assert [path for _, path in steps if not (ROOT / path).is_file()] == []


@pytest.mark.parametrize("walk", IN_0_1_0)
def test_imports_connect_each_step_to_those_before_it(walk: str) -> None:
    """Each file imports, or is imported by, a file that comes before it in the walk."""
    paths = [path for _, path in STEP.findall(WALKS[walk])]
    imports = {path: imported(path) for path in paths}
    loose = [
        path
        for place, path in enumerate(paths)
        if place and not any(path in imports[earlier] or earlier in imports[path] for earlier in paths[:place])
    ]
    assert loose == []


@pytest.mark.parametrize("walk", IN_0_1_0)
def test_a_walk_has_fewer_files_than_before(walk: str) -> None:
    """The page tells how many files the walk has and had in version 0.1.0, by the same rule."""
    told = COUNT.search(WALKS[walk])
    assert told
    assert int(told[1]) == len(STEP.findall(WALKS[walk]))
    assert int(told[2]) == len(IN_0_1_0[walk].split())
    assert int(told[1]) < int(told[2])


@pytest.mark.parametrize("caller", ["daemon/mismatch/run.py", "calibration/mismatch/comparison.py"])
def test_the_mismatch_walk_names_every_file_that_its_order_of_steps_calls(caller: str) -> None:
    """As a step or as a branch: no step is left out to make the walk shorter."""
    called = {path for path in imported(caller, at_run_time=True) if (ROOT / path).is_file()} - ONLY_DEFINE
    assert len(called) >= 5
    assert {path for path in called if f"`{path}`" not in WALKS["A CSV row becomes an answer"]} == set()
