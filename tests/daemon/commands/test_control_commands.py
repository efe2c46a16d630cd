"""The commands `traverse`, `stop` and `status`, with a daemon that answers with prepared replies."""

from __future__ import annotations

import json
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from typer.testing import CliRunner

from regolithd.daemon.cli import app
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.control import client
from regolithd.daemon.control.protocol import Accepted, Code, Done, Ended, Ending, NodeLine, Progress, Refused, Status

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

# What docs and --help promise: the defaults of each command's options.
DEFAULTS: dict[str, dict[str, Any]] = {
    "bench": {"channel": "vcan0", "interface": "socketcan", "seed": None, "no_noise": False, "seconds": 0.0},
    "check": {"config": Path("/etc/regolithd/rover.toml"), "syntax": False, "json": False},
    "demo": {"out": Path("build/demo"), "seconds": 30.0},
    "evaluate": {"rovers": 10_000, "drives": 400, "hours": 1.0, "part": "all", "seed": 31_907_442},
    "loop": {"seed": 1, "out": Path("build/loop"), "case": None, "short": False, "picture": None},
    "prove": {"recordings": 200, "seed": None, "jobs": 0, "solver": "", "keep": False, "duration": 1800.0},
    "reproduce": {"docs": Path("docs"), "trainings": 20},
    "run": {"config": Path("/etc/regolithd/rover.toml"), "verbose": False},
    "sizing": {"trainings": 100, "epochs": 10_000, "timing_epochs": 1000},
    "status": {"config": None, "json": False},
    "stop": {"quick": False, "config": None},
    "train": {"neurons": 64, "trainings": 100, "epochs": 10_000, "seed": 1, "config": None},
    "train-posterior": {"rovers": 1_500_000, "steps": 40_000, "seed": 1},
    "traverse": {"speed": 0.022, "config": None},
}


def regolithd(*arguments: object) -> Any:
    """Run a command and return its result: exit status, standard output and error."""
    return CliRunner().invoke(app, [str(each) for each in arguments])


class Daemon:
    """A daemon that answers with prepared replies."""

    def __init__(self, *replies: Any) -> None:
        self.replies = list(replies)
        self.requests: list[Any] = []

    def send(self, request: Any) -> None:
        """Keep a request."""
        self.requests.append(json.loads(request.line()))

    async def reply(self) -> Any:
        """Return the next reply."""
        return self.replies.pop(0)


@pytest.fixture
def answering(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a function that puts a daemon with these replies behind the control socket."""

    def prepare(*replies: Any) -> Daemon:
        daemon = Daemon(*replies)

        @asynccontextmanager
        async def connection(path: Path) -> AsyncIterator[Daemon]:
            assert path == Configuration().control.socket
            yield daemon

        monkeypatch.setattr(client, "control_connection", connection)
        return daemon

    return prepare


@pytest.mark.parametrize(("ending", "exit_code"), [(Ending.FINISHED, 0), (Ending.STOPPED, 1), (Ending.INCOMPLETE, 1)])
def test_a_traverse_ends_with_its_outcome(answering: Any, ending: Ending, exit_code: int) -> None:
    """Exit status 0 only if the whole distance was driven; the last line has time and distance."""
    daemon = answering(
        Accepted(duration_s=45.0, wheel_speed_rad_s=0.2),
        Progress(elapsed_s=1.0, turned_m=0.02),
        Ended(ending=ending, elapsed_s=45.4561, turned_m=1.00012, text="of a test"),
    )
    done = regolithd("traverse", "--distance", 1.0, "--speed", -0.03)
    assert daemon.requests == [{"command": "traverse", "distance_m": 1.0, "speed_m_s": -0.03}]
    assert done.exit_code == exit_code
    assert f"{ending.value.capitalize()} after 45.456 s, 1.000 m turned: of a test." in done.output


def test_a_refused_traverse_says_why(answering: Any) -> None:
    """Text and remedy go to standard error, exit status 1."""
    answering(Refused(code=Code.BUSY, text="Another one is driven.", remedy="Stop it."))
    done = regolithd("traverse", "--distance", 1.0)
    assert (done.exit_code, done.stderr.strip().splitlines()[-1]) == (1, "Not driven: Another one is driven. Stop it.")


@pytest.mark.parametrize(("options", "quick"), [((), False), (("--quick",), True)])
def test_stop_prints_the_answer(answering: Any, options: tuple[str, ...], quick: bool) -> None:
    """With the drives' ramp unless a quick stop is wanted."""
    daemon = answering(Done(text="The wheels stand still."))
    done = regolithd("stop", *options)
    assert (done.exit_code, done.stdout) == (0, "The wheels stand still.\n")
    assert daemon.requests == [{"command": "stop", "quick": quick}]
    answering(Refused(code=Code.NOT_READY, text="No bus."))
    done = regolithd("stop", *options)
    assert (done.exit_code, done.stderr) == (1, "Not stopped: No bus.\n")


def status_with(*phases: str, traverse: Progress | None = None) -> Status:
    """Return a status with one node for each phase."""
    nodes = tuple(
        NodeLine(
            node_id=10 + k, kind="motor", wheel=k or None, phase=phase, drive_state="fault" if k else None, text="why"
        )
        for k, (phase, drive_state) in enumerate(zip(phases, (None, "fault"), strict=False))
    )
    return Status(
        rover="kapvik", bus="active", broker="online", rate_Hz=2.0, snapshots=77, traverse=traverse, nodes=nodes
    )


@pytest.mark.parametrize(
    ("phases", "exit_code"),
    [(("operational", "operational"), 0), (("operational", "lost"), 1), (("booting",), 1), ((), 1)],
)
def test_status_is_0_only_if_every_node_is_operational(answering: Any, phases: tuple[str, ...], exit_code: int) -> None:
    """One node that is not operational, or none at all, gives 1; --json prints the daemon's answer."""
    answering(status_with(*phases))
    assert regolithd("status").exit_code == exit_code
    answering(status_with(*phases))
    done = regolithd("status", "--json")
    assert done.exit_code == exit_code
    assert json.loads(done.stdout) == json.loads(status_with(*phases).model_dump_json())


def test_status_shows_the_daemon_and_its_nodes(answering: Any) -> None:
    """A problem's text is shown where the node is not operational."""
    answering(status_with("operational", "lost", traverse=Progress(elapsed_s=3.21, turned_m=0.1234)))
    lines = regolithd("status").stdout.split()
    text = " ".join(lines)
    assert "kapvik · bus active · broker online · 77 snapshots at 2 Hz · traverse: 0.123 m turned, 3.2 s" in text
    assert "10 motor operational 11 motor 1 lost fault why" in text
    answering(status_with("operational"))
    assert "traverse: none" in " ".join(regolithd("status").stdout.split())
    answering(Done(text="odd"))
    done = regolithd("status")
    assert done.exit_code == 1
    assert "Unexpected answer" in done.stderr


def test_without_a_daemon_the_exit_status_is_that_of_sysexits(tmp_path: Path) -> None:
    """69 where no daemon answers, 78 where the configuration is invalid."""
    rover = tmp_path / "rover.toml"
    rover.write_text(f'[control]\nsocket = "{tmp_path}/control.sock"\n')
    done = regolithd("status", "--config", rover)
    assert done.exit_code == client.EX_UNAVAILABLE == 69
    assert client.EX_NOPERM == 77
    rover.write_text("[control]\nsockets = 3\n")
    assert regolithd("status", "--config", rover).exit_code == 78
