"""`regolithd check` on a real bus, with and without a daemon on it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from stack import Stack, stack_on

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(240)]


@pytest.fixture(scope="module")
def stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stack]:
    """A broker and a virtual rover, and the configuration of a daemon that does not run yet."""
    with stack_on("vcan0", tmp_path_factory.mktemp("check")) as stack:
        yield stack


def check(stack: Stack) -> tuple[int, dict[str, dict[str, str]]]:
    """Return the exit status, and what was found, by subject."""
    log = stack.folder / "check.log"
    log.unlink(missing_ok=True)
    status = stack.spawn("check", "check", "--json", "--config", str(stack.configuration)).wait(120)
    return status, {finding["subject"]: finding for finding in json.loads(log.read_text())}


def test_a_sound_rover_is_found_sound_and_then_not(stack: Stack) -> None:
    """First all is well; then a node has no power, one is somebody else, and each has its line."""
    status, found = check(stack)
    assert status == 0, found
    assert "vcan0 is up" in found["bus"]["text"]
    assert found["nodes"]["text"].startswith("12 of 12 answer and are who they should be")
    assert found["broker"]["verdict"] == found["model"]["verdict"] == "good"

    stack.tell_rover("off 13")
    stack.tell_rover("identity 4 product 0x999")
    status, found = check(stack)
    assert status == 1
    assert found["nodes"]["text"].startswith("10 of 12")
    assert found["node 13"]["verdict"] == found["node 4"]["verdict"] == "wrong"
    assert "0x" in found["node 4"]["text"]
    assert found["node 13"]["cure"]
    stack.tell_rover("on 13")
    stack.tell_rover("clear 4")


def test_a_running_daemon_is_asked_and_not_disturbed(stack: Stack) -> None:
    """The nodes that it has lost are told from its own words."""
    stack.start_daemon()
    status, found = check(stack)
    assert status == 0, found
    assert "12 of 12 are operational, says the running daemon" in found["nodes"]["text"]
    assert "a daemon answers" in found["control"]["text"]
    assert stack.ready()
