"""`regolithd check` on a vcan bus, with and without a running daemon."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from stack import Stack

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(240)]


def check(stack: Stack) -> tuple[int, dict[str, dict[str, str]]]:
    """Run the command; return its exit status and the findings by subject."""
    log = stack.folder / "check.log"
    log.unlink(missing_ok=True)
    status = stack.spawn("check", "check", "--json", "--config", str(stack.configuration)).wait(120)
    return status, {finding["subject"]: finding for finding in json.loads(log.read_text())}


def test_faulty_nodes_are_found_and_named(stack: Stack) -> None:
    """Nothing is wrong at first; then a node without power and one with another identity have a finding each."""
    status, found = check(stack)
    assert status == 0, found
    assert "vcan0 is up" in found["bus"]["text"]
    assert found["nodes"]["text"].startswith("12 of 12 answer with the expected identity")
    assert found["broker"]["verdict"] == found["model"]["verdict"] == "good"

    stack.inject_fault("off 13")
    stack.inject_fault("identity 4 product 0x999")
    status, found = check(stack)
    assert status == 1
    assert found["nodes"]["text"].startswith("10 of 12")
    assert found["node 13"]["verdict"] == found["node 4"]["verdict"] == "wrong"
    assert "0x" in found["node 4"]["text"]
    assert found["node 13"]["remedy"]
    stack.inject_fault("on 13")
    stack.inject_fault("clear 4")


def test_a_running_daemon_is_asked_and_not_disturbed(stack: Stack) -> None:
    """The findings about nodes come from the running daemon, which stays operational."""
    stack.start_daemon()
    status, found = check(stack)
    assert status == 0, found
    assert "12 of 12 are operational, says the running daemon" in found["nodes"]["text"]
    assert "a daemon answers" in found["control"]["text"]
    assert stack.ready()
