"""The simulated world: the paper's noise statistics, the wheel–soil model, determinism, the scenario file."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from pydantic import ValidationError

from regolithd.calibration.drivetrain.torque import wheel_torque
from regolithd.calibration.parameters import SOILS
from regolithd.calibration.terrain.wheel_soil import contact_angle
from regolithd.calibration.terrain.wheel_soil import wheel_torque as soil_torque
from regolithd.daemon.simulator.scenario import Ground, Hidden, Motion, Scenario, SensorNoise, read_scenario
from regolithd.daemon.simulator.virtual_rover import VirtualWorld

if TYPE_CHECKING:
    from regolithd.drivers.virtual import Measurement

FIELD_SPEED = np.full(6, 0.022 / 0.075 * 1400)  # rad/s at the motors: 2.2 cm/s at the rim
SAMPLE_S = 0.5


def drive(world: VirtualWorld, samples: int, speed: np.ndarray = FIELD_SPEED) -> list[Measurement]:
    """Drive at the paper's rate."""
    return [world.measure(SAMPLE_S * number, speed) for number in range(samples)]


def even(**tables: object) -> VirtualWorld:
    """Return a world without noise and without waves."""
    ground = {"wave_deg": 0.0} | dict(tables.pop("ground", {}))  # type: ignore[call-overload]
    return VirtualWorld(Scenario.model_validate({"noise": SensorNoise.none(), "ground": ground} | tables))


def test_the_same_seed_gives_the_same_numbers() -> None:
    """Two worlds of one seed agree to the last bit, and another seed gives different numbers."""
    first, second, other = (drive(VirtualWorld(Scenario(seed=seed)), 50) for seed in (3, 3, 4))
    for a, b, c in zip(first, second, other, strict=True):
        for field in fields(a):
            assert np.array_equal(getattr(a, field.name), getattr(b, field.name))
        assert not np.array_equal(a.motor_current_A, c.motor_current_A)


def test_noise_has_the_standard_deviations_of_the_paper() -> None:
    """%RSD of current and load for each wheel as in Table 4 (prepared ground), over the paper's 909 records."""
    noise = SensorNoise()
    records = drive(VirtualWorld(), 909)[2:]
    for values, expected in (
        (np.array([record.motor_current_A for record in records]), noise.current_relative_std),
        (np.array([record.load_N for record in records]), noise.load_relative_std),
    ):
        spread = values.std(axis=0) / values.mean(axis=0)
        # 907 samples of noise that is correlated over 0.2 s: the spread itself is known to about 3 %, five times that.
        assert spread == pytest.approx(expected, rel=0.15)


def test_the_current_is_near_the_papers() -> None:
    """The mean current of each wheel is 50–100 mA."""
    mean = np.mean([record.motor_current_A for record in drive(VirtualWorld(), 909)[2:]], axis=0)
    assert np.all((mean > 0.05) & (mean < 0.1))


def test_without_noise_the_current_is_the_models() -> None:
    """Eq. 11 inverts to Eq. 7's torque at the measured load and slip."""
    world = even()
    record = drive(world, 20)[-1]
    slip = 1 - record.hub_speed_m_s / (world.scenario.wheel.radius_m * FIELD_SPEED / 1400)
    assert slip == pytest.approx(0.025)
    soil, wheel = SOILS["sandy-loam"], world.scenario.wheel
    expected = soil_torque(contact_angle(record.load_N, slip, wheel, soil), slip, wheel, soil)
    assert wheel_torque(record.motor_current_A, FIELD_SPEED, world.scenario.drivetrain) == pytest.approx(expected)
    assert world.truth is not None
    assert world.truth.torque_Nm == pytest.approx(expected)


def test_the_loads_carry_the_rover() -> None:
    """The loads add up to the weight; pitching up loads the rear wheels, rolling right the right ones."""
    weight = 30 * 9.80665
    assert np.sum(drive(even(), 2)[-1].load_N) == pytest.approx(weight)
    up = drive(even(ground={"pitch_deg": 10.0}), 2)[-1]
    assert np.sum(up.load_N) == pytest.approx(weight * np.cos(np.radians(10)))
    assert np.all(up.load_N[4:] > up.load_N[2:4])
    assert np.all(up.load_N[2:4] > up.load_N[:2])
    side = drive(even(ground={"roll_deg": 10.0}), 2)[-1].load_N
    assert np.all(side[1::2] > side[::2])
    assert np.radians(10) == pytest.approx(up.pitch_rad)


def test_uphill_costs_current() -> None:
    """The current rises uphill and falls downhill."""
    down, level, up = (drive(even(ground={"pitch_deg": p}), 20)[-1].motor_current_A for p in (-10.0, 0.0, 10.0))
    assert np.all(down < level)
    assert np.all(level < up)


def test_the_front_wheels_reach_new_soil_first() -> None:
    """The ground truth lists the soil under each wheel, and each change."""
    stretches = [{"soil": "sandy-loam", "until_m": 1.0}, {"soil": "clayey-soil"}]
    world = even(ground={"stretches": stretches})
    records = drive(world, 140)
    loam, clay = "sandy-loam", "clayey-soil"
    assert [change.soils for change in world.changes] == [
        (loam,) * 6,
        (clay,) * 2 + (loam,) * 4,
        (clay,) * 4 + (loam,) * 2,
        (clay,) * 6,
    ]
    assert [round(change.distance_m, 1) for change in world.changes[1:]] == [0.7, 1.0, 1.3]
    currents = np.array([record.motor_current_A for record in records])
    assert np.all(currents[-1] < currents[10])  # clay resists less
    assert world.changes[-1].cohesion_Pa == pytest.approx(4120)


def test_backwards_currents_and_speeds_are_negative() -> None:
    """Driving backwards reverses the sign of current and speed, and standing still draws no current."""
    world = even()
    forward = world.measure(0.0, FIELD_SPEED).motor_current_A
    backward = world.measure(0.5, -FIELD_SPEED)
    assert backward.motor_current_A == pytest.approx(-forward)
    assert backward.ground_speed_m_s < 0
    assert world.measure(1.0, np.zeros(6)).motor_current_A == pytest.approx(0)


def test_faster_wheels_on_one_side_turn_the_rover() -> None:
    """Right wheels faster than left ones give a positive yaw rate, and faster hubs on the right."""
    record = even().measure(0.0, FIELD_SPEED * np.array([0.9, 1.1] * 3))
    assert record.yaw_rate_rad_s > 0
    assert np.all(record.hub_speed_m_s[1::2] > record.hub_speed_m_s[::2])


@pytest.mark.parametrize(
    ("hidden", "wheels"),
    [
        ({"bearing_drag": {"wheel": 3, "from_s": 5.0, "current_A": 0.01}}, [2]),
        ({"cold_drag_A": 0.02}, [0, 1, 2, 3, 4, 5]),
        ({"torque_constant_per_degC": 0.01}, [0, 1, 2, 3, 4, 5]),
        ({"ripple_A": 0.01}, [0, 1, 2, 3, 4, 5]),
    ],
)
def test_a_hidden_effect_changes_the_current(hidden: dict[str, object], wheels: list[int]) -> None:
    """Only the current of the wheels concerned changes."""
    with_it, without = drive(even(hidden=hidden), 30)[-1], drive(even(), 30)[-1]
    moved = np.flatnonzero(~np.isclose(with_it.motor_current_A, without.motor_current_A))
    assert moved.tolist() == wheels


def test_a_load_cell_may_drift() -> None:
    """The drift changes the reading and leaves the true load unchanged."""
    world = even(hidden={"load_drift": {"wheel": 2, "newton_per_s": 0.1}})
    record = drive(world, 21)[-1]
    assert world.truth is not None
    assert record.load_N - world.truth.load_N == pytest.approx([0, 1, 0, 0, 0, 0])


def test_a_wheel_that_sinks_to_its_axle_stalls() -> None:
    """Where the wheel–soil model has no solution, the current is finite and near the stall current."""
    soup = {"cohesion_Pa": 10, "friction_angle_deg": 5, "shear_modulus_m": 0.05, "sinkage_exponent": 1.0}
    soup |= {"k_c_kN": 0.1, "k_phi_kN": 1.0}
    record = drive(even(ground={"stretches": [{"soil": soup}]}), 3)[-1]
    assert np.all(np.isfinite(record.motor_current_A))
    assert np.all(record.motor_current_A > 0.9)


def test_a_scenario_file_may_name_soils(tmp_path: Path) -> None:
    """Soils are given by name, and missing keys have their defaults."""
    path = tmp_path / "scenario.toml"
    path.write_text(
        "seed = 9\n"
        '[[ground.stretches]]\nsoil = "lete-sand"\nuntil_m = 2.0\n'
        '[[ground.stretches]]\nsoil = "medium-soil"\n'
    )
    scenario = read_scenario(path)
    assert scenario.seed == 9
    assert [stretch.name for stretch in scenario.ground.stretches] == ["lete-sand", "medium-soil"]


def test_the_annotated_scenario_is_the_default_one() -> None:
    """`docs/reference/virtual-rover.toml` lists every key with its default."""
    path = Path(__file__).resolve().parents[3] / "docs" / "reference" / "virtual-rover.toml"
    assert read_scenario(path) == Scenario()
    listed = set(re.findall(r"^#? ?(\w+) =", path.read_text(), re.MULTILINE))
    tables = [Scenario, Ground, Motion, SensorNoise, Hidden]
    inner = {name for table in tables for name in table.model_fields} - set(Scenario.model_fields) - {"stretches"}
    assert inner <= listed


@pytest.mark.parametrize(
    "ground",
    [
        {"stretches": [{"soil": "cheese"}]},
        {"stretches": []},
        {"stretches": [{"soil": "lete-sand"}, {"soil": "medium-soil"}]},
        {
            "stretches": [
                {"soil": "lete-sand", "until_m": 2},
                {"soil": "medium-soil", "until_m": 1},
                {"soil": "lete-sand"},
            ]
        },
        {"stretches": [{"soil": "lete-sand", "until_m": 2}]},
    ],
)
def test_an_impossible_ground_is_refused(ground: dict[str, object]) -> None:
    """Unknown soils and unordered stretches are validation errors."""
    with pytest.raises(ValidationError):
        Scenario.model_validate({"ground": ground})


def test_a_rover_that_drives_far_and_back_meets_the_same_ground() -> None:
    """The terrain of the whole track is kept, for the way back."""
    world = VirtualWorld()
    begin = world._terrain.at(0.0)
    far = world._terrain.at(1000 * world.scenario.noise.terrain_length_m)
    np.testing.assert_array_equal(world._terrain.at(0.0), begin)
    assert not np.allclose(far, begin)
