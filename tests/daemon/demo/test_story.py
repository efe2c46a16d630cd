"""The demo's story: the axles cross one after the other, the alarm comes before the last, and the drag is concealed."""

from __future__ import annotations

import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

from regolithd.calibration.mismatch.simulation.rover_wheel import RoverWheel
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.demo.comparison import sim_toml
from regolithd.daemon.demo.crossings import crossings
from regolithd.daemon.demo.fast_forward import LaterWorld, fast_forward
from regolithd.daemon.demo.ground_truth_log import GroundTruthLog
from regolithd.daemon.demo.run import RATE_HZ, demo_configuration
from regolithd.daemon.demo.story import (
    BEFORE_BORDER_S,
    LEG_S,
    LEGS_M_S,
    LIVE_S,
    RAMP_S,
    SPEED_M_S,
    STEADY_S,
    WEAK,
    FastPart,
    fast_part,
    story_scenario,
)
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.pipeline.pipeline import Chain
from regolithd.daemon.simulator.pdo_frames import frames
from regolithd.daemon.simulator.virtual_rover import VirtualWorld

if TYPE_CHECKING:
    from regolithd.drivers.can.frame import Frame

START_NS = 1_700_000_000_000_000_000


def test_the_alarm_comes_before_the_rear_axle() -> None:
    """Computed as the demo computes it: front axle first, the rear one 30 s later, the alarm between; c falls."""
    configuration = demo_configuration(Path("out"), Path("temporary"), 1883)
    fast = fast_part(RATE_HZ, configuration.wheel.radius_m)
    world = VirtualWorld(story_scenario(fast))
    truth = GroundTruthLog(world)
    service: Any = SimpleNamespace(
        configuration=configuration, recorder=None, chain=Chain(configuration, load_models(configuration))
    )
    assert list(fast_forward(fast, world, service, truth, START_NS))
    assert world.truth is not None
    assert WEAK not in world.truth.soils
    end_s = len(fast.time_s) / RATE_HZ
    later, speed = LaterWorld(world, end_s), np.full(6, SPEED_M_S / configuration.wheel.radius_m * 1400)
    for time_s in np.arange(0, LIVE_S, 1 / RATE_HZ):
        read = later.measure(float(time_s), speed)
        sync_ns = START_NS + round((end_s + time_s) * 1e9)
        for estimate in service.chain.feed(frames(configuration.described(), sync_ns, speed, read)):
            truth.estimate(estimate)
    found = crossings(truth.records, START_NS + round(end_s * 1e9))
    assert list(found.axles) == ["front", "middle", "rear"]
    assert abs(found.axles["front"] - BEFORE_BORDER_S) < 2.5
    assert found.alarm_s is not None
    assert found.axles["front"] < found.alarm_s < found.axles["rear"] < LIVE_S
    medians = [each.posterior.cohesion_Pa.median for each, _ in truth.records if each.posterior]
    assert medians[-1] < 0.7 * medians[-100]


def test_the_result_says_when_the_axles_crossed() -> None:
    """One line for each axle and one for the alarm, with the time before the rear axle."""

    def record(time_s: float, weak: int, *, alarm: bool = False) -> Any:
        soils = ("sand",) * weak + ("loam",) * (6 - weak)
        snapshot = SimpleNamespace(time_ns=round(time_s * 1e9))
        return SimpleNamespace(snapshot=snapshot, soil_change=alarm or None), SimpleNamespace(soils=soils)

    records = [record(0, 0, alarm=True), record(11, 0), record(14, 2), record(22, 4, alarm=True), record(40, 6)]
    assert crossings(records, 10_000_000_000).lines == [
        "front axle on the weak soil from 4.0 s",
        "middle axle on the weak soil from 12.0 s",
        "rear axle on the weak soil from 30.0 s",
        "soil-change alarm at 12.0 s, 18.0 s before the rear axle",
    ]
    assert crossings(records[:1], 10_000_000_000).lines == ["no soil-change alarm in this drive"]


def test_the_simulation_is_told_what_the_daemon_is_told() -> None:
    """SIM.toml has the daemon's drivetrain, hence not the concealed drag, and can be loaded."""
    configuration = demo_configuration(Path("out"), Path("temporary"), 1883)
    tables = tomllib.loads(sim_toml(configuration))
    assert tables["drivetrain"]["viscous_current_A_s_per_rad"] == [0.0] * 6
    assert tables["drivetrain"]["no_load_current_A"] == [0.037] * 6
    assert RoverWheel.from_tables(tables).parameters


def test_the_fast_part_drives_every_leg_twice_and_then_steadily() -> None:
    """It ramps to each speed within two seconds, holds it to the leg's end, and ends at the speed of the crossing."""
    fast = fast_part(10.0, 0.1)
    time_s, speed = fast.time_s, 0.1 * fast.wheel_speed_rad_s
    np.testing.assert_allclose(np.diff(time_s), 0.1)
    assert (time_s[0], time_s[-1]) == (0.0, 2 * len(LEGS_M_S) * LEG_S + STEADY_S - 0.1)
    for number, wanted in enumerate(2 * LEGS_M_S):
        leg = (time_s >= number * LEG_S + RAMP_S) & (time_s <= (number + 1) * LEG_S)
        np.testing.assert_allclose(speed[leg], wanted)
    ramp = np.interp(1.0, time_s, speed)
    assert speed[0] == 0.0
    assert abs(ramp - LEGS_M_S[0] / 2) < 1e-9
    np.testing.assert_allclose(speed[time_s >= 2 * len(LEGS_M_S) * LEG_S + RAMP_S], SPEED_M_S)


def test_the_border_lies_ahead_of_the_front_axle_when_the_fast_part_ends() -> None:
    """So far that the front axle reaches it four seconds later, with the slip of the firm soil."""
    fast = fast_part(10.0, 0.075)
    driven = np.sum(0.075 * fast.wheel_speed_rad_s) * 0.1 * (1 - 0.025)
    assert fast.distance_m(0.075, 0.025) == pytest.approx(driven)
    scenario = story_scenario(fast)
    firm, weak = scenario.ground.stretches
    front = fast.distance_m(scenario.wheel.radius_m, scenario.motion.slip) + scenario.rover.wheelbase_m / 2
    assert firm.until_m == pytest.approx(front + BEFORE_BORDER_S * SPEED_M_S * (1 - scenario.motion.slip))
    assert (weak.name, weak.until_m) == (WEAK, None)


class Noted:
    """A recorder and a pipeline that keep what they get."""

    def __init__(self) -> None:
        self.batches: list[int] = []
        self.estimates: list[int] = []
        self.flushed: list[int] = []

    def feed(self, batch: list[Frame]) -> list[int]:
        """Return one estimate for each batch."""
        return [len(batch)]

    def frames(self, batch: list[Frame]) -> None:
        """Keep the time of the batch."""
        self.batches.append(batch[0].time_ns)

    def estimate(self, estimate: int) -> None:
        """Keep an estimate."""
        self.estimates.append(estimate)

    def flush(self) -> None:
        """Note after how many batches."""
        self.flushed.append(len(self.batches))


def test_what_is_computed_is_recorded_as_if_it_were_live() -> None:
    """Frames before their estimates, flushed every hundred instants; the seconds driven are told as often."""
    time_s = 0.1 * np.arange(250)
    noted, of_truth = Noted(), Noted()
    service: Any = SimpleNamespace(configuration=Configuration(), recorder=noted, chain=noted)
    world = VirtualWorld()
    told = list(fast_forward(FastPart(time_s, np.full(250, 0.3)), world, service, cast("Any", of_truth), START_NS))
    assert told == pytest.approx([0.0, 10.0, 20.0])
    assert noted.flushed == [1, 101, 201]
    assert len(noted.estimates) == len(of_truth.estimates) == 250
    assert noted.batches[-1] - noted.batches[0] == round(24.9e9)
    assert world.truth is not None
    assert world.truth.distance_m > 0.4
    silent: Any = SimpleNamespace(configuration=Configuration(), recorder=None, chain=noted)
    later = LaterWorld(world, 25.0)
    later.measure(1.5, np.zeros(6))
    assert world.truth.time_s == 26.5
    still = FastPart(30 + time_s[:2], np.zeros(2))
    assert list(fast_forward(still, world, silent, cast("Any", of_truth), START_NS)) == [30.0]
