"""The demo's parts: tables, bars, screen and picture, from made-up messages and records."""

from __future__ import annotations

import asyncio
import io
import json
import math
import socket
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from golden import assert_golden, description
from matplotlib.figure import Figure
from rich.console import Console, RenderableType

from regolithd.calibration.posterior.estimator import Interval, Posterior
from regolithd.daemon.demo import picture, run, screen
from regolithd.daemon.demo.ground_truth_log import GroundTruthLog, posteriors_on_soils, wheels_on_soils
from regolithd.daemon.demo.interval_bar import SCALES, interval_bar
from regolithd.daemon.demo.live_table import LiveTable, sparkline
from regolithd.daemon.demo.result_tables import posterior_table, wheel_table
from regolithd.daemon.demo.story import LIVE_S
from regolithd.daemon.messages.channels import CHANNELS
from regolithd.daemon.messages.examples import example
from regolithd.drivers.master.status import NodePhase

GOLDEN = Path(__file__).with_name("golden")
PREFIX = "regolith/kapvik"
EXAMPLES = {channel.name: example(channel) for channel in CHANNELS}


def printed(*shown: RenderableType) -> str:
    """Return what a terminal of 84 columns shows, with its colours."""
    console = Console(record=True, width=84, force_terminal=True, color_system="truecolor", file=io.StringIO())
    for each in shown:
        console.print(each)
    return "\n".join(line.rstrip() for line in console.export_text(styles=True).splitlines()) + "\n"


def plain(shown: RenderableType) -> str:
    """Return the text without colours."""
    console = Console(record=True, width=84, file=io.StringIO())
    console.print(shown)
    return console.export_text()


def interval(median: float) -> dict[str, float]:
    """Return an interval of ± 10 % (50 %) and ± 30 % (90 %)."""
    levels = {"low_90": 0.7, "low_50": 0.9, "median": 1.0, "high_50": 1.1, "high_90": 1.3, "mean": 1.02}
    return {name: level * median for name, level in levels.items()}


def wheel(number: int, **changes: Any) -> tuple[str, bytes]:
    """Return topic and payload of a wheel's message."""
    message = EXAMPLES["wheel"] | {"wheel": number} | changes
    return f"{PREFIX}/wheel/{number}", json.dumps(message).encode()


def filled() -> LiveTable:
    """Return a table with a message of each kind, five wheels in different states, and one that has sent nothing."""
    table = LiveTable(PREFIX, paper=True)
    for torque in (0.2, 0.5, 1.0, 1.9):
        table.take(*wheel(1, smoothed_torque_Nm=torque))
    table.take(
        *wheel(2, measured=False, valid=False, smoothed_torque_Nm=None, cohesion_Pa=None, friction_angle_rad=None)
    )
    table.take(*wheel(3, valid=False, slip=None, slip_source="none"))
    table.take(*wheel(4, valid=False, slip_source="ground-speed"))
    table.take(*wheel(5, outside_training_range=["load_N", "slip", "motor_current_A", "humidity"]))
    table.take(f"{PREFIX}/snapshot", b"{}")
    table.take(f"{PREFIX}/state", b'{"state": "online"}')
    table.take(f"{PREFIX}/unknown", b"")
    medians = {"cohesion_Pa": 3000.0, "friction_angle_rad": 0.5, "drawbar_margin": 0.2}
    table.take(
        f"{PREFIX}/posterior",
        json.dumps({"instants": 16} | {name: interval(value) for name, value in medians.items()}).encode(),
    )
    return table


def test_the_live_table_shows_the_newest_messages() -> None:
    """Numbers in display units, a history of torques, the reason where there is no estimate, and the posterior."""
    table = filled()
    assert (table.messages, table.snapshots, table.state) == (12, 1, "online")
    assert_golden(printed(table.render()), GOLDEN / "live-table.txt")


def test_an_empty_table_waits() -> None:
    """Before the first message every wheel is waiting, and the rover is offline."""
    table = LiveTable(PREFIX)
    assert (table.messages, table.snapshots, table.posterior, table.alarms) == (0, 0, None, {})
    assert_golden(printed(table.render()), GOLDEN / "empty-table.txt")


def test_the_oldest_present_alarm_is_shown() -> None:
    """An alarm that is no longer active is removed; a long text is broken into at most four lines."""
    table = filled()
    for name, active in (("bus", True), ("clock", True), ("bus", False)):
        payload = json.dumps({"active": active, "text": f"text of {name}"}).encode()
        table.take(f"{PREFIX}/alarm/{name}", payload)
    assert table.alarms == {"clock": "text of clock"}
    assert "▲ ALARM text of clock" in plain(table.render())
    table.alarms["clock"] = "word " * 100
    assert len(table._alarm_lines()) == 4
    assert max(len(line) for line in table._alarm_lines()) <= 80


def test_the_soil_under_a_wheel_is_marked_where_it_is_not_the_first() -> None:
    """The simulator alone knows it; before the first snapshot nobody does."""
    stretches = [SimpleNamespace(name="loose sand"), SimpleNamespace(name="crust"), SimpleNamespace(name="gravel")]
    scenario = SimpleNamespace(ground=SimpleNamespace(stretches=stretches))
    soils = ("loose sand", "crust", "loose sand", "gravel", "crust", "crust")
    world: Any = SimpleNamespace(scenario=scenario, truth=SimpleNamespace(soils=soils))
    shown = [LiveTable(PREFIX, world)._soil(number) for number in range(1, 7)]
    assert tuple(text.plain for text in shown) == soils
    assert [number for number, text in enumerate(shown, 1) if text.style == "dim"] == [1, 3]
    world.truth = None
    assert LiveTable(PREFIX, world)._soil(1).plain == "–"


def test_twelve_torques_are_kept() -> None:
    """The history drops the oldest; a missing torque is not kept."""
    table = LiveTable(PREFIX)
    for number in range(14):
        table.take(*wheel(1, smoothed_torque_Nm=float(number)))
    table.take(*wheel(1, smoothed_torque_Nm=None))
    assert list(table.torque[1]) == [float(number) for number in range(2, 14)]


@pytest.mark.parametrize(
    ("values", "top", "blocks"),
    [([], 1.0, ""), ([-1.0, 0.0, 0.124, 0.125, 0.5, 0.99, 1.0, 9.0], 1.0, "▁▁▁▂▅███"), ([1.0, 2.0], 2.0, "▅█")],
)
def test_a_sparkline_has_eight_levels(values: list[float], top: float, blocks: str) -> None:
    """Equal steps from 0 to the top; values outside are cut off."""
    assert sparkline(values, top) == blocks


@pytest.mark.parametrize(
    ("scale", "median", "text"),
    [
        (0, 0.0, "cohesion c       │●                                 │ 0.0 kPa  0.0 … 0.0"),
        (0, 5000.0, "cohesion c       │            ───━●━━───            │ 5.0 kPa  3.5 … 6.5"),
        (0, 50000.0, "cohesion c       │                                 ●│50.0 kPa  35.0 … 65.0"),
        (1, math.radians(30), "friction angle φ │               ─────━━●━━─────    │    30 °  21 … 39"),
        (2, 0.5, "drawbar margin   │                  ───━━●━━───     │    50 %  35 … 65"),
    ],
)
def test_a_bar_shows_both_intervals_and_the_median(scale: int, median: float, text: str) -> None:
    """Label, 34 columns between the axis limits, and the median and the 90 % interval in display units."""
    assert interval_bar(SCALES[scale], interval(median)).plain == text


def estimated(time_s: float, *, valid: bool = True, posterior: Posterior | None = None, torque: float = 1.0) -> Any:
    """Return an estimate with a value of its own for each wheel."""
    six = np.arange(6.0)
    outside = np.zeros((3, 6), bool)
    outside[1, 2] = time_s >= 6
    return SimpleNamespace(
        snapshot=SimpleNamespace(time_ns=5_000_000_000 + round(time_s * 1e9)),
        smoothed_torque_Nm=torque + 0.1 * six,
        cohesion_Pa=3000 + 100 * six,
        friction_angle_rad=0.5 + 0.01 * six,
        valid=np.full(6, valid),
        outside=outside,
        posterior=posterior,
    )


def truth(time_s: float, soils: tuple[str, ...]) -> Any:
    """Return a ground truth with a value of its own for each wheel."""
    six = np.arange(6.0)
    return SimpleNamespace(
        time_s=time_s,
        soils=soils,
        torque_Nm=1.1 + 0.1 * six,
        cohesion_Pa=3100 + 100 * six,
        friction_angle_rad=0.45 + 0.01 * six,
    )


def posterior(factor: float) -> Posterior:
    """Return a posterior around 3 kPa and 0.5 rad, times a factor."""
    found = [Interval(**interval(value * factor)) for value in (3000.0, 0.5, 0.2)]
    return Posterior(*found, wheels=6, instants=16)


def records() -> list[Any]:
    """Return ten seconds: the front wheels change soil after 4 s, all others after 7 s; the first two are not valid."""
    made = []
    for second in range(10):
        front, rear = ("sand" if second >= 4 else "loam"), ("sand" if second >= 7 else "loam")
        known = posterior(1 + second / 10) if second % 2 else None
        one = estimated(second, valid=second >= 2, posterior=known, torque=1.0 + second)
        made.append((one, truth(second, (front,) * 2 + (rear,) * 4)))
    return made


def test_means_leave_out_the_time_after_a_change_of_soil() -> None:
    """Each wheel on each soil, in the order driven; the first two seconds on a soil are left out."""
    found = wheels_on_soils(records(), settle_s=2.0)
    assert [(each.wheel, each.soil, each.records) for each in found[:5]] == [
        (1, "sand", 4),
        (2, "sand", 4),
        (3, "loam", 3),
        (3, "sand", 1),
        (4, "loam", 3),
    ]
    first, third = found[0], found[2]
    assert first.torque_Nm == pytest.approx(np.mean([7.0, 8.0, 9.0, 10.0]))
    assert third.torque_Nm == pytest.approx(1.2 + np.mean([4.0, 5.0, 6.0]))
    assert (third.cohesion_Pa, third.true_cohesion_Pa, third.true_torque_Nm) == pytest.approx((3200, 3300, 1.3))
    assert (third.friction_angle_rad, third.true_friction_angle_rad) == pytest.approx((0.52, 0.47))
    assert [each.outside for each in found[:4]] == pytest.approx([0.0, 0.0, 1 / 3, 1.0])
    assert len(wheels_on_soils(records(), settle_s=0.0)) == 12
    assert wheels_on_soils(records(), settle_s=20.0) == []


def test_the_last_posterior_on_each_soil_is_kept() -> None:
    """Only where all six wheels were on one soil."""
    found = posteriors_on_soils(records())
    assert [(each.soil, each.posterior.cohesion_Pa.median) for each in found] == [
        ("loam", pytest.approx(3900.0)),
        ("sand", pytest.approx(5700.0)),
    ]
    assert (found[0].true_cohesion_Pa, found[0].true_friction_angle_rad) == (3100.0, 0.45)


def test_the_result_tables() -> None:
    """Each wheel's number is printed once; true values are in brackets."""
    shown = (wheel_table(wheels_on_soils(records(), 2.0)), posterior_table(posteriors_on_soils(records())))
    assert_golden(printed(*shown), GOLDEN / "results.txt")


def test_the_picture_shows_estimates_and_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines, intervals, labels and limits are those that were reviewed."""
    drawn: list[Figure] = []
    save = Figure.savefig
    options: list[dict[str, Any]] = []

    def keep(self: Figure, *arguments: Any, **given: Any) -> None:
        drawn.append(self)
        options.append(given)
        save(self, *arguments, **given)

    monkeypatch.setattr(Figure, "savefig", keep)
    missing = records()
    missing[1][0].smoothed_torque_Nm[:] = np.nan
    picture.draw(missing, tmp_path / "drive.png")
    assert_golden(description(drawn[0]), GOLDEN / "picture.txt")
    assert options == [{"dpi": 130}]
    assert (tmp_path / "drive.png").read_bytes().startswith(b"\x89PNG")
    picture.draw([(estimated(0.0), truth(0.0, ("loam",) * 6))], tmp_path / "no-posterior.png")
    assert not drawn[1].axes[1].collections


def test_the_screen_is_redrawn_on_a_terminal_and_printed_every_10_s_elsewhere() -> None:
    """Title, progress and table; without a terminal the first table comes after 10 s."""
    assert_golden(printed(screen.frame(filled(), 12.4, 30.0)), GOLDEN / "screen.txt")
    out = io.StringIO()
    with screen.screen(Console(file=out, width=100), 30.0) as show:
        assert out.getvalue().strip() == screen.TITLE
        for computed in (0.0, 60.0, 600.0):
            show.computing(computed, 600.0)
        for elapsed in (0.0, 9.9, 10.0, 10.3, 19.9, 20.0, 30.0):
            show.driving(LiveTable(PREFIX), elapsed)
    assert out.getvalue().count(f"{screen.COMPUTING}: 10 min") == 1
    times = [line for line in out.getvalue().splitlines() if " of 30 s" in line]
    assert times == ["10 of 30 s", "20 of 30 s", "30 of 30 s"]
    out = io.StringIO()
    with screen.screen(Console(file=out, width=100, force_terminal=True), 30.0) as show:
        show.computing(120.0, 600.0)
        show.driving(LiveTable(PREFIX), 3.0)
    assert "2 of 10 min" in out.getvalue()
    assert "3 of 30 s" in out.getvalue()


async def test_the_log_keeps_estimates_once_there_is_a_truth() -> None:
    """An estimate before the first measurement is left out; events are kept."""
    world = SimpleNamespace(truth=None)
    log = GroundTruthLog(world)
    log.estimate(estimated(0.0))
    world.truth = "truth"
    one = estimated(1.0)
    log.estimate(one)
    log.event("event")
    assert log.records == [(one, "truth")]
    assert log.events == ["event"]
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.01):
            await log.run()


def test_the_demo_is_configured_for_one_process(tmp_path: Path) -> None:
    """An in-process bus, a drivetrain without the concealed drag, and files in the two folders."""
    configuration = run.demo_configuration(tmp_path / "out", tmp_path / "temporary", 1883)
    assert (configuration.bus.interface, configuration.bus.channel) == ("virtual", "demo")
    assert configuration.sync.rate_Hz == run.RATE_HZ
    assert configuration.drivetrain.viscous_current_A_s_per_rad == (0.0,) * 6
    assert (configuration.nodes.inclinometer, configuration.nodes.ground_speed) == (21, 22)
    assert configuration.nodes.motor_diagnostics
    assert configuration.drivetrain.gain_relative_std == 0.03
    assert configuration.drivetrain.no_load_current_std_A == (0.001,) * 6
    assert min(configuration.drivetrain.no_load_current_A) > 0
    assert configuration.posterior.window_s == 8.0
    assert (configuration.recording.directory, configuration.recording.limit_MB) == (tmp_path / "out", 500)
    assert (configuration.mqtt.host, configuration.mqtt.port) == ("127.0.0.1", 1883)
    assert configuration.mqtt.spool_directory == tmp_path / "temporary" / "spool"
    assert configuration.control.socket == tmp_path / "temporary" / "control.sock"


async def test_the_demo_waits_until_every_node_is_operational() -> None:
    """One node that boots is enough to wait."""
    status = {1: SimpleNamespace(phase=NodePhase.OPERATIONAL), 2: SimpleNamespace(phase=NodePhase.BOOTING)}
    waiting = asyncio.ensure_future(run._operational(SimpleNamespace(status=status)))
    await asyncio.sleep(0.02)
    assert not waiting.done()
    status[2].phase = NodePhase.OPERATIONAL
    async with asyncio.timeout(10):
        await waiting


async def test_the_table_is_shown_until_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four times a second, and once more at the end with the whole duration."""
    now, shown, slept = [100.0], [], []

    async def sleep(seconds: float) -> None:
        slept.append(seconds)
        now[0] += seconds

    monkeypatch.setattr(run.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(run.asyncio, "sleep", sleep)
    await run._show_repeatedly(LiveTable(PREFIX), 1.0, lambda _table, elapsed: shown.append(elapsed))
    assert shown == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert slept == [0.25] * 4


async def test_the_subscriber_fills_the_table_from_the_embedded_broker() -> None:
    """It subscribes to everything below the prefix, and nothing else reaches the table."""
    import aiomqtt  # noqa: PLC0415  # only here

    from regolithd.daemon.demo.broker import embedded_broker  # noqa: PLC0415  # amqtt is slow to import

    table, subscribed = LiveTable(PREFIX), asyncio.Event()
    async with asyncio.timeout(60), embedded_broker() as port:
        reading = asyncio.ensure_future(run._subscribe(table, port, subscribed))
        await subscribed.wait()
        async with aiomqtt.Client("127.0.0.1", port) as client:
            await client.publish("another/rover/snapshot", b"{}")
            await client.publish(f"{PREFIX}/state", b'{"state": "online"}')
        while table.state != "online":  # noqa: ASYNC110  # no event
            await asyncio.sleep(0.01)
        reading.cancel()
    assert table.messages == 1
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", port)) != 0


def test_the_screenshot_is_the_first_screen_with_the_alarm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """84 columns, without web fonts, with the elapsed time of that screen."""
    from regolithd.daemon.demo import screenshot  # noqa: PLC0415  # only here

    async def run_demo(_folder: Path, seconds: float, show: Any) -> None:
        assert seconds == LIVE_S
        show.computing(1.0, 2.0)
        for elapsed in (0.0, 5.0, 20.4, 25.0, 30.0):
            table = filled()
            if elapsed > 20:
                table.alarms["soil-change"] = "the soil is weaker"
            show.driving(table, elapsed)

    monkeypatch.setattr(screenshot, "run_demo", run_demo)
    screenshot.screenshot(tmp_path / "demo.svg")
    svg = (tmp_path / "demo.svg").read_text()
    text = svg.replace("&#160;", " ")
    assert "20 of 44 s" in text
    assert "ALARM the soil is weaker" in text
    assert "25 of 44 s" not in text
    assert "make demo" in text
    assert "@font-face" not in svg
    assert screenshot.COLUMNS == 84
