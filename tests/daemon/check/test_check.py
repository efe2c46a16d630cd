"""`regolithd check` reports every problem with what to do, also on a computer without bus, broker and models."""

import asyncio
import grp
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from broker import Mosquitto, unused_port

from regolithd.calibration.models.card import ModelCard, Variable
from regolithd.daemon.check.broker import check_broker
from regolithd.daemon.check.bus import check_bus, check_link, check_load, judge_link, judge_nodes, nodes_of_daemon
from regolithd.daemon.check.clock import ClockState, check_clock, judge_clock, kernel_clock_state
from regolithd.daemon.check.control import check_control, running_daemon
from regolithd.daemon.check.disk import check_disks, check_folder
from regolithd.daemon.check.finding import Verdict
from regolithd.daemon.check.models import check_models, judge_card
from regolithd.daemon.config.configuration import Bus, Configuration, Control, Mqtt, Recording
from regolithd.daemon.control.client import ControlError
from regolithd.daemon.control.protocol import NodeLine, Status
from regolithd.drivers.devices.ground_speed import GROUND_SPEED_SENSOR
from regolithd.drivers.devices.load_cell import LOAD_CELL
from regolithd.drivers.devices.motor_controller import MOTOR_CONTROLLER
from regolithd.drivers.devices.node import NodeDescription
from regolithd.drivers.master.scan import ScanResult

ROOT = Path(__file__).resolve().parents[3]
CALIBRATED = {"drivetrain": {"no_load_current_A": 0.037}}
NOW_S = 1_790_000_000.0
GROUP = grp.getgrgid(os.getgid()).gr_name


def check(*options: str) -> subprocess.CompletedProcess[str]:
    """Run `regolithd check` as a command."""
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src"), "COLUMNS": "200"}
    command = [sys.executable, "-m", "regolithd", "check", *options]
    return subprocess.run(command, capture_output=True, text=True, env=environment, check=False, timeout=60)


def test_five_mistakes_are_five_lines_and_status_78(tmp_path: Path) -> None:
    """Each line has file, line, key, the expected and the found value, and what to do."""
    config = tmp_path / "rover.toml"
    config.write_text(
        """\
[sync]
rate_Hz = 500
[nodes]
motors = [1, 2, 3, 4, 5, 5]
[wheel]
radius_m = -0.075
[mqtt]
prot = 1883
host = ""
"""
    )
    run = check("--config", str(config))
    assert run.returncode == 78
    lines = run.stderr.splitlines()
    assert len(lines) == 6
    keys = ("sync.rate_Hz", "nodes.motors[5]", "wheel.radius_m", "mqtt.prot", "mqtt.host")
    for key in keys:
        assert sum(f": {key}: expected " in line for line in lines) == 1, key
    assert lines[-1].startswith("5 problems")
    assert run.stdout == ""
    told = json.loads(check("--config", str(config), "--json").stdout)
    assert len(told) == 5


def test_syntax_alone_touches_nothing(tmp_path: Path) -> None:
    """`--syntax` reads the file and checks nothing else, for use during installation."""
    run = check("--syntax", "--config", str(ROOT / "rover.toml"))
    assert (run.returncode, run.stdout) == (0, f"{ROOT / 'rover.toml'}: good\n")
    assert check("--syntax", "--config", str(tmp_path / "absent.toml")).returncode == 78


def test_where_hardly_anything_is_there_everything_is_reported_at_once(tmp_path: Path) -> None:
    """Without link, broker, model, group and folder there are five wrong findings, and the status is 1."""
    config = tmp_path / "rover.toml"
    (tmp_path / "file").touch()
    config.write_text(
        f"""\
[bus]
channel = "can77"
[estimator]
model = "absent.onnx"
[recording]
directory = "{tmp_path}/file/recordings"
[mqtt]
host = "127.0.0.1"
port = {unused_port()}
spool_directory = "{tmp_path}/spool"
[control]
group = "no-such-group"
socket = "{tmp_path}/control.sock"
"""
    )
    run = check("--config", str(config), "--json")
    assert run.returncode == 1, run.stderr
    found = {line["subject"]: line for line in json.loads(run.stdout)}
    wrong = {subject for subject, line in found.items() if line["verdict"] == "wrong"}
    assert wrong == {"bus", "model", "broker", "recording", "control"}
    assert "there is no link 'can77'" in found["bus"]["text"]
    assert found["nodes"]["verdict"] == "not checked"
    assert found["store"]["verdict"] == "good"
    assert "clock" in found
    shown = check("--config", str(config)).stdout
    assert "5 wrong" in shown
    assert "groupadd --system no-such-group" in shown


async def test_a_broker_that_accepts_us_and_one_that_does_not(mosquitto: Mosquitto, tmp_path: Path) -> None:
    """A broker that accepts the credentials is good, one that refuses is wrong and the remedy names the keys."""
    settings = Mqtt(host="127.0.0.1", port=mosquitto.port)
    (finding,) = await check_broker(Configuration(mqtt=settings))
    assert finding.verdict is Verdict.GOOD
    mosquitto.stop()
    mosquitto.settings = "allow_anonymous false\n"
    mosquitto.start()
    (finding,) = await check_broker(Configuration(mqtt=settings))
    assert (finding.verdict, "refused" in finding.text) == (Verdict.WRONG, True)
    assert "password_file" in finding.remedy
    absent = settings.model_copy(update={"username": "me", "password_file": tmp_path / "absent"})
    (finding,) = await check_broker(Configuration(mqtt=absent))
    assert "absent" in finding.text


@pytest.mark.parametrize(
    ("details", "verdict", "said"),
    [
        ({"linkinfo": {"info_data": {"bittiming": {"bitrate": 500_000}}}}, Verdict.WRONG, "500000 bit/s"),
        ({"linkinfo": {"info_data": {"bittiming": {"bitrate": 1_000_000}, "state": "BUS-OFF"}}}, Verdict.WRONG, "off"),
        (
            {"linkinfo": {"info_data": {"bittiming": {"bitrate": 1_000_000}, "state": "ERROR-PASSIVE"}}},
            Verdict.WARNING,
            "error-passive",
        ),
        (
            {"linkinfo": {"info_data": {"bittiming": {"bitrate": 1_000_000}, "state": "ERROR-ACTIVE"}}},
            Verdict.GOOD,
            "1000000 bit/s",
        ),
        ({"linkinfo": {"info_kind": "vcan"}}, Verdict.GOOD, "vcan"),
        ({}, Verdict.GOOD, "is up"),
    ],
)
def test_a_link_is_judged_by_what_iproute2_says(details: dict, verdict: Verdict, said: str) -> None:
    """Bit rate and error state decide; without iproute2, that the link is up."""
    finding = judge_link(Bus(), details)
    assert (finding.verdict, said in finding.text) == (verdict, True)
    assert bool(finding.remedy) == (verdict is not Verdict.GOOD)


def test_a_link_that_is_no_can_link_is_reported() -> None:
    """The loopback interface is reported as no CAN link."""
    (finding,) = check_link(Bus(channel="lo"), {})
    assert (finding.verdict, "no CAN link" in finding.text) == (Verdict.WRONG, True)


@pytest.mark.parametrize(
    ("rate_Hz", "bitrate", "verdicts"),
    [
        (2, 125_000, []),
        (200, 1_000_000, []),
        (100, 250_000, []),
        (200, 250_000, ["wrong"]),
        (150, 250_000, ["warning"]),
    ],
)
def test_a_bus_that_will_be_too_full_is_reported(rate_Hz: int, bitrate: int, verdicts: list[str]) -> None:
    """The bus load counts the longest form of every frame that the configured nodes send."""
    configuration = Configuration(sync={"rate_Hz": rate_Hz}, bus={"bitrate": bitrate})
    assert [finding.verdict for finding in check_load(configuration)] == verdicts


async def test_an_in_process_bus_is_not_probed() -> None:
    """A bus inside one process, as in the demo, is not checked and not wrong."""
    (finding,) = await check_bus(Configuration(bus=Bus(interface="virtual")), None)
    assert finding.verdict is Verdict.UNKNOWN


def test_each_node_that_is_not_right_has_its_line() -> None:
    """A node that is not required gives a warning, any other an error."""
    motor = NodeDescription(1, MOTOR_CONTROLLER, 0)
    cell = NodeDescription(11, LOAD_CELL, 0)
    speed = NodeDescription(22, GROUND_SPEED_SENSOR, None, required=False)
    found = judge_nodes(
        [
            ScanResult(motor, answers=True, identity=None, nmt_state=None),
            ScanResult(cell, answers=False, identity=None, nmt_state=None, problem="no answer", remedy="power it"),
            ScanResult(speed, answers=False, identity=None, nmt_state=None, problem="no answer", remedy="power it"),
        ]
    )
    assert [(finding.subject, finding.verdict) for finding in found] == [
        ("nodes", Verdict.GOOD),
        ("node 11", Verdict.WRONG),
        ("node 22", Verdict.WARNING),
    ]
    assert "1 of 3 answer" in found[0].text


def status(*phases: str) -> Status:
    """Return the status of a running daemon."""
    nodes = tuple(
        NodeLine(node_id=n, kind="motor", wheel=n, phase=phase, drive_state=None, text="")
        for n, phase in enumerate(phases, start=1)
    )
    return Status(rover="kapvik", bus="open", broker="", rate_Hz=2, snapshots=0, traverse=None, nodes=nodes)


def test_a_running_daemon_is_asked_instead_of_the_bus() -> None:
    """The states of the nodes come from the running daemon, since two masters would disturb each other."""
    found = nodes_of_daemon(status("operational", "lost"))
    assert [(finding.subject, finding.verdict) for finding in found] == [
        ("nodes", Verdict.GOOD),
        ("node 2", Verdict.WRONG),
    ]
    assert nodes_of_daemon(status())[0].verdict is Verdict.WRONG


@pytest.mark.parametrize(
    ("state", "jump_ns", "now_s", "verdict", "said"),
    [
        (ClockState(synchronised=True, largest_error_s=0.004), 0, NOW_S, Verdict.GOOD, "4.0 ms"),
        (ClockState(synchronised=False, largest_error_s=16.0), 0, NOW_S, Verdict.WARNING, "not synchronised"),
        (ClockState(synchronised=True, largest_error_s=0.5), 0, NOW_S, Verdict.WARNING, "0.500 s"),
        (ClockState(synchronised=True, largest_error_s=0.004), -80_000_000, NOW_S, Verdict.WRONG, "-0.080 s"),
        (None, 0, NOW_S, Verdict.UNKNOWN, "does not say"),
        (ClockState(synchronised=True, largest_error_s=0.004), 0, 86_400.0, Verdict.WRONG, "1970-01-02"),
    ],
)
def test_the_clock_is_judged(state: ClockState | None, jump_ns: int, now_s: float, verdict: Verdict, said: str) -> None:
    """The kernel's state, a jump during the observation, and an implausible date each decide."""
    finding = judge_clock(state, jump_ns, now_s)
    assert (finding.verdict, said in finding.text) == (verdict, True)


async def test_this_computers_clock_can_be_asked() -> None:
    """Linux always reports the state of its clock, synchronised or not."""
    said = kernel_clock_state()
    assert said is not None
    assert 0 <= said.largest_error_s < 1e4
    (finding,) = await check_clock()
    assert finding.verdict in {Verdict.GOOD, Verdict.WARNING}


def test_a_folder_that_may_grow_beyond_its_disk_is_reported(tmp_path: Path) -> None:
    """A folder that may grow beyond its disk is a warning while at least 100 MB are free, then wrong."""
    assert check_folder("store", tmp_path, 1.0, "[mqtt] spool_directory").verdict is Verdict.GOOD
    assert check_folder("store", tmp_path / "new", 1.0, "[mqtt] spool_directory").text.count("will be created") == 1
    finding = check_folder("store", tmp_path, 1e12, "[mqtt] spool_directory")
    assert finding.verdict is Verdict.WARNING
    assert "the disk has" in finding.text
    (tmp_path / "file").touch()
    assert check_folder("store", tmp_path / "file", 1.0, "[mqtt] spool_directory").verdict is Verdict.WRONG


@pytest.mark.parametrize(
    ("free_MB", "used_MB", "limit_MB", "verdict"),
    [
        (500.0, 0.0, 499.0, Verdict.GOOD),
        (500.0, 2.0, 502.0, Verdict.GOOD),  # what is used already does not come again
        (500.0, 0.0, 501.0, Verdict.WARNING),
        (99.0, 0.0, 101.0, Verdict.WRONG),
        (49.0, 0.0, 50.0, Verdict.WRONG),
        (10.0, 2.0, 1.0, Verdict.GOOD),  # beyond its limit already: it shrinks
    ],
)
def test_free_space_is_judged_by_what_a_folder_may_still_grow(
    free_MB: float, used_MB: float, limit_MB: float, verdict: Verdict, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Too little is a warning while 100 MB or all that is wanted are free, else wrong."""
    (tmp_path / "file").write_bytes(bytes(round(used_MB * 1e6)))
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=free_MB * 1e6))
    assert check_folder("store", tmp_path, limit_MB, "[mqtt] spool_directory").verdict is verdict


def test_a_folder_of_another_user_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With who asked; a parent that may not be entered leaves it unknown."""
    monkeypatch.setattr(os, "access", lambda *_: False)
    monkeypatch.setenv("USER", "ada")
    finding = check_folder("store", tmp_path, 1.0, "[mqtt] spool_directory")
    assert (finding.verdict, f"{tmp_path} cannot be written by you (ada)" in finding.text) == (Verdict.WRONG, True)
    monkeypatch.delenv("USER")
    assert f"(user {os.getuid()})" in check_folder("store", tmp_path, 1.0, "").text

    def refuse(_: Path) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(shutil, "disk_usage", refuse)
    finding = check_folder("store", tmp_path, 1.0, "[mqtt] spool_directory")
    assert (finding.verdict, finding.text) == (Verdict.UNKNOWN, f"{tmp_path}: Permission denied")


async def test_the_recordings_folder_is_checked_where_recordings_are_written(tmp_path: Path) -> None:
    """Otherwise it is said that they are not; the store's is always checked."""
    for enabled, verdict in ((True, Verdict.GOOD), (False, Verdict.UNKNOWN)):
        configuration = Configuration(
            recording=Recording(enabled=enabled, directory=tmp_path, limit_MB=1.0),
            mqtt=Mqtt(spool_directory=tmp_path, spool_limit_MB=1.0),
        )
        found = await check_disks(configuration)
        assert [(finding.subject, finding.verdict) for finding in found] == [
            ("recording", verdict),
            ("store", Verdict.GOOD),
        ]


async def test_a_network_that_does_not_suit_the_rover_is_reported(tmp_path: Path) -> None:
    """A network for other loads is a warning, a file that is no network is wrong."""
    card = ModelCard("small-1", (Variable("load_N", "N", 1.0, 10.0),), (), 1.0)
    assert judge_card(card, Configuration()).verdict is Verdict.WARNING
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"no network")
    both = Configuration.model_validate({"estimator": {"model": broken}, "posterior": {"model": broken}} | CALIBRATED)
    found = await check_models(both)
    assert [(each.subject, each.verdict) for each in found] == [
        ("model", Verdict.WRONG),
        ("posterior", Verdict.WRONG),
    ]
    finding, _ = await check_models(Configuration())
    assert finding.verdict is Verdict.GOOD


async def test_who_may_command_is_reported(tmp_path: Path) -> None:
    """The finding tells whether the user is in the group, and whether a daemon runs."""
    configuration = Configuration(control=Control(group=GROUP, socket=tmp_path / "control.sock"))
    assert await running_daemon(configuration) is None
    (finding,) = check_control(configuration, None)
    assert (finding.verdict, "no daemon is running" in finding.text) == (Verdict.UNKNOWN, True)
    assert check_control(configuration, status("operational"))[0].verdict is Verdict.GOOD
    (finding,) = check_control(configuration, ControlError("No permission to open it. Join the group.", 77))
    assert (finding.verdict, finding.remedy) == (Verdict.WARNING, "Join the group.")

    configuration.control.socket.touch()
    (finding,) = check_control(configuration, await running_daemon(configuration))
    assert (finding.verdict, finding.text) == (Verdict.WRONG, f"{configuration.control.socket} is not a socket")
    configuration.control.socket.unlink()

    silent = await asyncio.start_unix_server(lambda _, writer: writer.close(), configuration.control.socket)
    async with silent:
        assert await running_daemon(configuration) is None


def test_who_is_not_in_the_group_may_not_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Unless the group is one of the further groups, or the user is root; a group that is not there is wrong."""
    number = grp.getgrnam(GROUP).gr_gid
    configuration = Configuration(control=Control(group=GROUP, socket=tmp_path / "control.sock"))
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(os, "getegid", lambda: number + 1)
    for groups, verdict in (([], Verdict.WARNING), ([number], Verdict.GOOD)):
        monkeypatch.setattr(os, "getgroups", lambda groups=groups: groups)
        (finding,) = check_control(configuration, status("operational"))
        assert finding.verdict is verdict
    monkeypatch.setattr(os, "getgroups", list)
    monkeypatch.setattr(os, "getegid", lambda: number)
    assert check_control(configuration, status("operational"))[0].verdict is Verdict.GOOD
    unknown = Configuration(control=Control(group="nobody-has-this-group", socket=tmp_path / "control.sock"))
    (finding,) = check_control(unknown, None)
    assert finding.verdict is Verdict.WRONG
    assert finding.remedy
    assert "nobody-has-this-group" in finding.text


async def test_what_answers_in_another_language_is_no_daemon(tmp_path: Path) -> None:
    """Another program's socket."""
    configuration = Configuration(control=Control(socket=tmp_path / "control.sock"))

    def greet(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"220 ready\n")
        writer.close()

    other = await asyncio.start_unix_server(greet, configuration.control.socket)
    async with other:
        assert await running_daemon(configuration) is None


async def test_a_drivetrain_that_nobody_calibrated_means_no_intervals_and_a_known_one_does() -> None:
    """Without calibration there is a warning, with it none, and a posterior for another wheel is wrong."""
    known = {"no_load_current_A": 0.037}
    cases = {
        Verdict.WARNING: Configuration(),
        Verdict.GOOD: Configuration.model_validate({"drivetrain": known}),
        Verdict.WRONG: Configuration.model_validate({"drivetrain": known, "wheel": {"radius_m": 0.2}}),
    }
    for verdict, configuration in cases.items():
        _, finding = await check_models(configuration)
        assert (finding.subject, finding.verdict) == ("posterior", verdict)
