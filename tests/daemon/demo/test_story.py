"""The demo's story: the axles cross one after the other, the alarm comes before the last, and the drag is concealed."""

from __future__ import annotations

import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from regolithd.calibration.mismatch.simulation.rover_wheel import RoverWheel
from regolithd.daemon.demo.comparison import sim_toml
from regolithd.daemon.demo.crossings import crossings
from regolithd.daemon.demo.fast_forward import LaterWorld, fast_forward
from regolithd.daemon.demo.ground_truth_log import GroundTruthLog
from regolithd.daemon.demo.run import RATE_HZ, demo_configuration
from regolithd.daemon.demo.story import BEFORE_BORDER_S, LIVE_S, SPEED_M_S, WEAK, fast_part, story_scenario
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.pipeline.pipeline import Chain
from regolithd.daemon.simulator.pdo_frames import frames
from regolithd.daemon.simulator.virtual_rover import VirtualWorld

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
