"""A change of soil raises one alarm, with its evidence, and a steady drive raises none."""

import numpy as np

from regolithd.calibration.parameters import SOILS
from regolithd.calibration.posterior.change_detection import Alarm
from regolithd.calibration.posterior.estimator import FallProbability
from regolithd.daemon.config.configuration import Configuration
from regolithd.daemon.pipeline.onnx_models import load_models
from regolithd.daemon.pipeline.pipeline import Pipeline
from regolithd.daemon.pipeline.snapshot import QUANTITIES, Snapshot, SoilChange
from regolithd.daemon.pipeline.soil_change import SoilChangeDetector, soil_change_text
from regolithd.daemon.simulator.scenario import Ground, Scenario, Stretch
from regolithd.daemon.simulator.virtual_rover import VirtualWorld

HALF_SECOND_NS = 500_000_000


def watch(torque: np.ndarray) -> list[Alarm]:
    """Return the alarms of a level drive; torque in half seconds, shape (time, 6)."""
    detector = SoilChangeDetector(Configuration())
    load, slip = np.full(6, 49.0), np.full(6, 0.025)
    found = [detector.step(k * HALF_SECOND_NS, load, slip, row) for k, row in enumerate(torque)]
    return [alarm for alarm in found if alarm is not None]


def noisy(half_seconds: int) -> np.ndarray:
    """Return a torque of 0.4 N·m with more noise than signal, as behind a gearbox."""
    return 0.4 + 0.3 * np.random.default_rng(3).standard_normal((half_seconds, 6))


def test_a_fall_of_torque_raises_one_alarm_within_fifteen_seconds() -> None:
    """The torque falls from 0.4 to 0.15 N·m, as from medium soil to LETE sand, after four minutes."""
    torque = noisy(600)
    torque[480:] -= 0.25
    (alarm,) = watch(torque)
    assert alarm.direction == "fall"
    assert 0 < alarm.time_ns / HALF_SECOND_NS - 480 <= 30
    assert 0.1 < alarm.torque_ratio < 0.8
    text = soil_change_text(SoilChange(alarm, FallProbability(0.97, 0.6, 0.9)))
    assert text.startswith("the soil is weaker: wheel torque fell to ")
    assert "threshold 10.8); probability of a decrease: cohesion 97 %" in text


def test_a_steady_drive_momentary_drops_and_missing_wheels_raise_none() -> None:
    """Twenty minutes with a drop to zero every ten seconds, and one wheel missing for a minute, raise no alarm."""
    torque = noisy(2400)
    torque[::20, 1] = 0.0
    torque[600:720, 4] = np.nan
    torque[1000:1010] = np.nan
    assert watch(torque) == []


def test_through_the_whole_pipeline_the_alarm_says_how_likely_the_soil_is_weaker() -> None:
    """The virtual rover drives from medium soil onto LETE sand, at 2 Hz and 5 cm/s."""
    stretches = (Stretch(soil=SOILS["medium-soil"], until_m=8.0), Stretch(soil=SOILS["lete-sand"]))
    scenario = Scenario(ground=Ground(stretches=stretches))
    world = VirtualWorld(scenario)
    known = scenario.drivetrain.model_dump() | {"no_load_current_std_A": 0.001, "gain_relative_std": 0.03}
    configuration = Configuration.model_validate({"drivetrain": known})
    pipeline = Pipeline(configuration, load_models(configuration))
    speed = np.full(6, 0.05 / 0.075 * scenario.drivetrain.ratio)
    changes = []
    for k in range(420):
        measured = world.measure(k / 2, speed)
        values = np.full((len(QUANTITIES), 6), np.nan)
        values[:3] = measured.motor_current_A, speed, measured.load_N
        values[3] = measured.ground_speed_m_s
        estimate = pipeline.step(Snapshot(k, 10**18 + k * HALF_SECOND_NS, values))
        changes += [estimate.soil_change] if estimate.soil_change else []
    (changed,) = changes
    assert changed.alarm.direction == "fall"
    assert changed.fall is not None
    assert changed.fall.cohesion > 0.7
