"""`regolithd monitor` follows the daemon's recording while it is written, and reports a drag before the drive ends."""

from __future__ import annotations

import asyncio
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from recorded_traverse import NO_LOAD_A, ROVER, daemon
from subscriber import Subscriber, listening, until
from typer.testing import CliRunner

from regolithd.calibration.mismatch.online.left_out import LeftOutReadings
from regolithd.calibration.mismatch.online.report import UNNAMED, Change, Report
from regolithd.calibration.mismatch.online.thresholds import OnlineThresholds
from regolithd.calibration.parameters import Drivetrain
from regolithd.daemon.cli import app
from regolithd.daemon.closed_loop.simulated_drive import START_NS, estimates, simulate
from regolithd.daemon.closed_loop.speed_profile import shuttle
from regolithd.daemon.commands.compare import publish_result
from regolithd.daemon.config.reader import read_configuration
from regolithd.daemon.mismatch.online.monitoring import Told, line_of, lines_of, monitored
from regolithd.daemon.mismatch.online.result import monitoring_result
from regolithd.daemon.mismatch.traverse import simulation_toml
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.recording.recorder import Recorder
from regolithd.daemon.simulator.scenario import BearingDrag, Hidden, Scenario

if TYPE_CHECKING:
    from collections.abc import Iterator

    from broker import Mosquitto

WHEEL, ONSET_S, LENGTH_S = 3, 390.0, 660.0
LIMITS = OnlineThresholds(interval_s=30.0, learning_intervals=10)
CHANGE = Change(
    name="bearing-drag",
    wheels=(4,),
    onset_s=600.0,
    onset_low_s=540.0,
    onset_high_s=660.0,
    parameter="drag_current",
    size=0.02,
    low=0.015,
    high=0.025,
    unit="A",
    statistic=40.0,
    first_reported_s=720.0,
    rivals=(),
    statement="Drag that was not there before",
)


class GrowingDrive:
    """A drive of the virtual rover whose recording is written a minute at a time; a bearing fails on its way."""

    def __init__(self, folder: Path) -> None:
        (folder / "rover.toml").write_text(ROVER.format(port=1))
        configuration = read_configuration(folder / "rover.toml")
        self.simulation = folder / "SIM.toml"
        self.simulation.write_text(simulation_toml(configuration))
        without = configuration.posterior.model_copy(
            update={"soil": None}
        )  # the posterior of a soil costs half a minute
        configuration = configuration.model_copy(update={"posterior": without})
        drag = BearingDrag(wheel=WHEEL, from_s=ONSET_S, current_A=0.04)
        drivetrain = Drivetrain(no_load_current_A=(NO_LOAD_A,) * 6)
        scenario = Scenario(hidden=Hidden(grade_resistance=0.0, bearing_drag=drag), drivetrain=drivetrain)
        profile = shuttle(3, LENGTH_S, configuration.sync.rate_Hz)
        drive = simulate(scenario, configuration, profile, START_NS)
        network = load_models(configuration).terrain
        self._coming: Iterator = estimates(drive, configuration, network)
        self._per_minute = round(60 * configuration.sync.rate_Hz)
        self.recorder = Recorder(configuration.recording, "vcan0", {}, lambda: START_NS)
        self.written_s = 0.0

    def write(self, _seconds: float) -> None:
        """Write another minute, and close the file behind the last."""
        for _ in range(self._per_minute):
            estimate = next(self._coming, None)
            if estimate is None:
                self.recorder.close()
                return
            self.recorder.estimate(estimate)
            self.written_s = (estimate.snapshot.time_ns - START_NS) / 1e9
        self.recorder.flush()


def test_a_drag_is_reported_while_the_drive_is_recorded(tmp_path: Path) -> None:
    """With its wheel and its onset, before its end is written."""
    drive = GrowingDrive(tmp_path)
    assert drive.recorder.paths
    followed = monitored(
        drive.recorder.paths[0], drive.simulation, follow=True, announce=print, sleep=drive.write, thresholds=LIMITS
    )
    first = next(told for told in followed if told.changes)
    assert ONSET_S < first.time_s <= drive.written_s < LENGTH_S - 60
    (change,) = list(followed)[-1].changes
    assert (change.name, change.wheels) == ("bearing-drag", (WHEEL,))
    assert change.onset_low_s is not None
    assert change.onset_high_s is not None
    assert change.onset_low_s <= ONSET_S <= change.onset_high_s


def told(*changes: Change, not_compared: str = "", left_out: tuple[LeftOutReadings, ...] = ()) -> Told:
    """Return what is known after twelve minutes."""
    report = Report(
        720.0,
        learning=False,
        compared_intervals=12,
        not_compared=not_compared,
        leading=9.0,
        alarm=20.0,
        changes=changes,
        left_out=(),
        left_out_readings=left_out,
    )
    return Told("rover.mcap", {"motor_current_A": report}, ())


def test_the_terminal_shows_what_is_new() -> None:
    """A change once, its withdrawal, and why a minute was not compared."""
    (line,) = lines_of(told(CHANGE), None)
    assert line == "   12.0 min  motor_current_A: bearing-drag: Drag that was not there before"
    assert lines_of(told(CHANGE), told(CHANGE)) == []
    assert lines_of(told(), told(CHANGE)) == ["   12.0 min  motor_current_A: withdrawn: bearing-drag on 4"]
    assert lines_of(told(not_compared="it stands"), None)[0].endswith("not compared: it stands")


def test_a_wheel_that_is_left_out_is_told_once() -> None:
    """When it has lasted, when it is over, and in the notes of the JSON; brief blanks are in the table alone."""
    brief = told(left_out=(LeftOutReadings(3, "load_N was not measured", 40, None),))
    lasting = told(left_out=(LeftOutReadings(3, "load_N was not measured", 240, 600.0),))
    said = "wheel 3 is not compared since 600 s: load_N was not measured"
    assert lines_of(brief, None) == []
    assert lines_of(lasting, brief) == [f"   12.0 min  motor_current_A: {said}"]
    assert lines_of(lasting, lasting) == []
    assert lines_of(brief, lasting) == [f"   12.0 min  motor_current_A: over: {said}"]
    assert json.loads(line_of(lasting))["notes"] == [f"W{said[1:]}."]
    (row,) = json.loads(line_of(brief))["channels"]["motor_current_A"]["left_out_readings"]
    assert row == {"wheel": 3, "reason": "load_N was not measured", "readings": 40, "since_s": None}


def test_what_has_no_name_is_unexplained() -> None:
    """In the verdict of the message."""
    nameless = replace(CHANGE, name=UNNAMED)
    assert monitoring_result(told(nameless), Path("SIM.toml")).verdict == "unexplained"
    assert monitoring_result(told(nameless, CHANGE), Path("SIM.toml")).verdict == "missing-physics"


def test_each_interval_is_a_line_of_json() -> None:
    """With the leading statistic, the threshold, and the changes."""
    content = json.loads(line_of(told(CHANGE)))
    assert content["channels"]["motor_current_A"]["changes"][0]["onset_s"] == 600.0
    assert content["channels"]["motor_current_A"]["alarm"] == 20.0


def test_a_recording_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    """With the status of unusable data."""
    (tmp_path / "rover.toml").write_text(ROVER.format(port=1))
    simulation = tmp_path / "SIM.toml"
    simulation.write_text(simulation_toml(read_configuration(tmp_path / "rover.toml")))
    done = CliRunner().invoke(app, ["monitor", str(tmp_path / "none.mcap"), "--simulation", str(simulation)])
    assert done.exit_code == 65
    assert "none.mcap is not there" in done.output


def test_a_whole_file_is_monitored_to_its_end(tmp_path: Path) -> None:
    """Each minute of a CSV file is a line of the JSON file; where nothing moves, it says why nothing is compared."""
    (tmp_path / "rover.toml").write_text(ROVER.format(port=1))
    simulation = tmp_path / "SIM.toml"
    simulation.write_text(simulation_toml(read_configuration(tmp_path / "rover.toml")))
    lines = [f"{second},{wheel},0.1,0,50" for second in range(150) for wheel in range(1, 7)]
    recording = tmp_path / "bench.csv"
    recording.write_text("t_s,wheel,motor_current_A,motor_speed_rad_s,load_N\n" + "\n".join(lines) + "\n")
    out = tmp_path / "known.jsonl"
    done = CliRunner().invoke(
        app, ["monitor", str(recording), "--simulation", str(simulation), "--json", str(out)], catch_exceptions=False
    )
    assert done.exit_code == 0
    assert len(out.read_text().splitlines()) == 3
    assert "not compared" in done.output


async def test_the_daemon_publishes_what_has_begun(tmp_path: Path, mosquitto: Mosquitto) -> None:
    """As the retained `mismatch` message, with an alarm, and without a report."""
    (tmp_path / "rover.toml").write_text(ROVER.format(port=mosquitto.port))
    (tmp_path / "recordings").mkdir()
    configuration = read_configuration(tmp_path / "rover.toml")
    result = monitoring_result(told(CHANGE), tmp_path / "SIM.toml")
    with daemon(tmp_path):
        await asyncio.to_thread(publish_result, configuration, result)
        async with listening(Subscriber(mosquitto.port)) as subscriber:
            await until(lambda: all(subscriber.of(topic) for topic in ("mismatch", "alarm/mismatch")))
    (message,), (alarm,) = subscriber.of("mismatch"), subscriber.of("alarm/mismatch")
    assert message["effects"][0]["where"] == "wheel 4"
    assert "bearing-drag" in message["text"]
    assert alarm["active"]
    assert not subscriber.of("report")


def test_nothing_that_has_begun_is_consistent() -> None:
    """After a withdrawal the message says so."""
    assert monitoring_result(told(), Path("SIM.toml")).verdict == "consistent"
