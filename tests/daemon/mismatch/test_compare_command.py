"""`regolithd compare`: the last traverse alone is compared, the result is published, and the alarm says what is new."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
import typer
from recorded_traverse import ROVER, daemon, drive_traverse
from running import running
from subscriber import Subscriber, listening, until
from typer.testing import CliRunner

from regolithd.calibration.mismatch.answer import Answer, Change, Effect, FitImprovement, Parameter
from regolithd.calibration.mismatch.errors import RecordingError
from regolithd.calibration.mismatch.simulation.rover_wheel import RoverWheel
from regolithd.daemon.cli import app
from regolithd.daemon.closed_loop.simulated_drive import START_NS
from regolithd.daemon.commands import compare
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.config.reader import read_configuration
from regolithd.daemon.control.traversed import Traversed
from regolithd.daemon.ground.web.reports import html
from regolithd.daemon.mismatch.result import comparison_result
from regolithd.daemon.mismatch.traverse import TraverseFiles, extract_last_traverse, simulation_toml
from regolithd.daemon.publish.comparison import publish_comparison
from regolithd.daemon.publish.publisher import Publisher
from regolithd.daemon.publish.stores import Stores

if TYPE_CHECKING:
    from pathlib import Path

    from broker import Mosquitto

    from regolithd.daemon.messages.mismatch import ComparisonResult

DRAG = Effect(
    name="viscous-friction",
    channel="motor_current_A",
    wheels=(1, 2, 3, 4, 5, 6),
    covariate="wheel_speed",
    onset_s=None,
    equation="",
    statement="Drag that grows with speed",
    parameters={"coefficient": Parameter(4.1e-5, 3.6e-5, 4.5e-5, "A s/rad")},
    rmse_before=2.0,
    rmse_after=1.0,
)
QUIET = Answer("consistent", (), (), (), (), FitImprovement("motor_current_A", 1.0, 1.0, 1.0))
MISSING = replace(QUIET, verdict="missing-physics", effects=(DRAG,))
CHANGED = replace(QUIET, changes=(Change("viscous-friction", "coefficient", 4e-5, 8e-5, 7e-5, 9e-5),))


def test_the_rows_of_the_last_traverse_are_compared_and_no_others(tmp_path: Path) -> None:
    """The file begins with the traverse and ends with it; without any row there is nothing to compare."""
    recordings = drive_traverse(tmp_path, 1, 60.0, 0.0).recording.directory
    files = extract_last_traverse(recordings)
    lines = files.recording.read_text().splitlines()
    assert len(lines) == 1 + 6 * (40 * 2 + 1)
    assert files.recording.name == "traverse-20130611T140732Z.csv"
    Traversed(from_ns=START_NS + 10**14, to_ns=START_NS + 10**14 + 1, ending="stopped").write(recordings)
    with pytest.raises(RecordingError, match="no snapshot of the traverse"):
        extract_last_traverse(recordings)


def test_without_a_traverse_the_message_says_what_to_do(tmp_path: Path) -> None:
    """One line, and the exit status of unusable data."""
    (tmp_path / "rover.toml").write_text(ROVER.format(port=1))
    (tmp_path / "recordings").mkdir()
    done = CliRunner().invoke(app, ["compare", "--config", str(tmp_path / "rover.toml")])
    assert done.exit_code == 65
    assert "no traverse has ended since recordings are written here" in done.output


@pytest.mark.parametrize("soil", [None, "clayey-soil"])
def test_the_simulation_has_what_rover_toml_states(soil: str | None) -> None:
    """Drivetrain, wheel and rover are the rover's; an unknown soil is stated as such; the simulation can be loaded."""
    configuration = Configuration.model_validate(
        {"drivetrain": {"no_load_current_A": 0.04}, "rover": {"mass_kg": 31.5}, "posterior": {"soil": soil}}
    )
    tables = tomllib.loads(simulation_toml(configuration))
    assert tables["drivetrain"]["no_load_current_A"] == [0.04] * 6
    assert tables["rover"]["mass_kg"] == 31.5
    assert tables["soil"]["cohesion_relative_std"] == (0.05 if soil else 0.5)
    assert tables["soil"]["cohesion_Pa"] == (4120 if soil else 3150)
    assert RoverWheel.from_tables(tables).parameters


@pytest.mark.parametrize(
    ("answer", "active", "text"),
    [
        (QUIET, False, "The simulation agrees with the traverse."),
        (MISSING, True, "The simulation leaves out: viscous-friction."),
        (CHANGED, True, "Changed since the simulation was corrected: viscous-friction."),
    ],
    ids=["quiet", "missing", "changed"],
)
async def test_the_alarm_is_active_where_physics_is_missing_or_has_changed(
    answer: Answer, active: bool, text: str, tmp_path: Path, mosquitto: Mosquitto
) -> None:
    """Result, report and alarm are retained: a subscriber that comes later gets all three."""
    (tmp_path / "a.html").write_text("<h1>found</h1>")
    files = TraverseFiles(tmp_path / "a.csv", tmp_path / "a.html", tmp_path / "a.json", tmp_path / "a.toml")
    configuration = Configuration.model_validate({"mqtt": {"host": "127.0.0.1", "port": mosquitto.port}})
    publisher = Publisher(configuration, Stores.open(tmp_path / "spool", 1_000_000))
    async with running(publisher):
        await publish_comparison(publisher, comparison_result(answer, files, tmp_path / "SIM.toml"))
        await until(lambda: publisher.report.acknowledged == 3)
    async with listening(Subscriber(mosquitto.port)) as subscriber:
        await until(lambda: all(subscriber.of(topic) for topic in ("alarm/mismatch", "mismatch", "report")))
    (alarm,), (result,) = subscriber.of("alarm/mismatch"), subscriber.of("mismatch")
    assert html(json.dumps(subscriber.of("report")[0]).encode()) == b"<h1>found</h1>"
    assert (alarm["active"], alarm["text"]) == (active, text)
    assert result["text"] == text
    assert len(result["effects"]) == len(answer.effects)
    assert len(result["changes"]) == len(answer.changes)


def comparison_of(folder: Path, report: Path) -> ComparisonResult:
    """Return a result with this report."""
    files = TraverseFiles(folder / "a.csv", report, folder / "a.json", folder / "a.toml")
    return comparison_result(QUIET, files, folder / "SIM.toml")


def test_without_a_daemon_the_result_is_not_published(tmp_path: Path) -> None:
    """The status is that of an unavailable service, which systemd tries again."""
    configuration = Configuration.model_validate({"control": {"socket": tmp_path / "none.sock"}})
    with pytest.raises(typer.Exit) as ended:
        compare._publish(configuration, comparison_of(tmp_path, tmp_path / "a.html"))
    assert ended.value.exit_code == 69


def test_no_file_outside_the_recordings_is_published(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A client of the control socket cannot have another file of the daemon's sent, and a report must be there."""
    (tmp_path / "rover.toml").write_text(ROVER.format(port=1))
    (tmp_path / "secret").write_text("secret")
    configuration = read_configuration(tmp_path / "rover.toml")
    with daemon(tmp_path):
        for path, said in (("secret", "is not below"), ("recordings/none.html", "cannot be read")):
            with pytest.raises(typer.Exit):
                compare._publish(configuration, comparison_of(tmp_path, tmp_path / path))
            assert said in capsys.readouterr().err
