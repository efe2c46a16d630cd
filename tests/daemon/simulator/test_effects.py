"""The size of each effect in the simulated world, and the limits of a scenario's keys."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from golden import assert_golden
from pydantic import ValidationError

from regolithd.calibration.drivetrain.torque import motor_current
from regolithd.calibration.parameters import SOILS, Rover, Wheel
from regolithd.daemon.simulator import virtual_rover
from regolithd.daemon.simulator.scenario import Scenario, SensorNoise, Stretch
from regolithd.daemon.simulator.virtual_rover import VirtualWorld

if TYPE_CHECKING:
    from regolithd.drivers.virtual import Measurement

GOLDEN = Path(__file__).with_name("golden")
RATIO, RADIUS_M = Scenario().drivetrain.ratio, Wheel().radius_m
CREEP = np.full(6, 0.3 * RATIO)
"""All wheels at 0.3 rad/s."""


def even(**tables: Any) -> VirtualWorld:
    """Return a world without noise and without waves."""
    ground = {"wave_deg": 0.0} | tables.pop("ground", {})
    return VirtualWorld(Scenario.model_validate({"noise": SensorNoise.none(), "ground": ground} | tables))


def after(world: VirtualWorld, seconds: float, speed: np.ndarray = CREEP, step_s: float = 0.5) -> Measurement:
    """Drive for a time and return the last measurement."""
    return [world.measure(step_s * k, speed) for k in range(round(seconds / step_s) + 1)][-1]


def added(hidden: dict[str, Any], seconds: float = 10.0, **tables: Any) -> np.ndarray:
    """Return the current that a hidden effect adds [A]."""
    return (
        after(even(hidden=hidden, **tables), seconds).motor_current_A - after(even(**tables), seconds).motor_current_A
    )


def digits(values: Any) -> str:
    """Return a number, or several, to six digits."""
    return " ".join(f"{value:.6g}" for value in np.ravel(values))


def test_a_drive_with_every_effect_has_the_reviewed_numbers() -> None:
    """One seed, all noise, slopes, two soils, all hidden effects, turns and a stop: numbers to six digits."""
    scenario = Scenario.model_validate(
        {
            "seed": 11,
            "ground": {
                "stretches": [{"soil": "lete-sand", "until_m": 0.15}, {"soil": "medium-soil"}],
                "pitch_deg": 3.0,
                "roll_deg": -2.0,
                "wave_deg": 4.0,
                "wave_length_m": 0.6,
            },
            "noise": {"drops_per_s": 0.5},
            "hidden": {
                "cold_drag_A": 0.01,
                "torque_constant_per_degC": 0.002,
                "ripple_A": 0.004,
                "bearing_drag": {"wheel": 2, "from_s": 4.0, "current_A": 0.02},
                "load_drift": {"wheel": 5, "newton_per_s": -0.2},
            },
        }
    )
    world, lines = VirtualWorld(scenario), []
    speeds = [CREEP] * 8 + [CREEP * np.array([0.9, 1.1] * 3)] * 4 + [0.1 * CREEP] * 2 + [0 * CREEP, -CREEP]
    for number, speed in enumerate(speeds):
        read = world.measure(0.75 * number, speed)
        truth = world.truth
        assert truth is not None
        measured = ("motor_current_A", "load_N", "motor_temperature_degC", "hub_speed_m_s", "bus_voltage_V")
        body = ("pitch_rad", "roll_rad", "yaw_rate_rad_s", "ground_speed_m_s")
        true = ("load_N", "slip", "torque_Nm", "cohesion_Pa", "friction_angle_rad")
        lines += [f"{number} {name} {digits(getattr(read, name))}" for name in (*measured, *body)]
        lines += [f"{number} true {name} {digits(getattr(truth, name))}" for name in true]
        lines.append(f"{number} true {truth.time_s:.6g} {truth.distance_m:.6g} {' '.join(truth.soils)}")
    lines.append(f"changes {[f'{change.time_s:g}' for change in world.changes]}")
    assert_golden("\n".join(lines) + "\n", GOLDEN / "drive.txt")


def test_a_bearing_drags_from_its_time_on() -> None:
    """The current of its wheel alone, in the direction of rotation."""
    hidden = {"bearing_drag": {"wheel": 3, "from_s": 5.0, "current_A": 0.01}}
    assert added(hidden, 4.5) == pytest.approx(0.0, abs=1e-12)
    assert added(hidden, 5.0) == pytest.approx([0, 0, 0.01, 0, 0, 0], rel=1e-3, abs=1e-6)
    backwards = after(even(hidden=hidden), 6.0, -CREEP).motor_current_A - after(even(), 6.0, -CREEP).motor_current_A
    assert backwards == pytest.approx([0, 0, -0.01, 0, 0, 0], rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("ambient_degC", [0.0, 10.0, 20.0])
def test_cold_drag_falls_by_a_factor_e_every_ten_degrees(ambient_degC: float) -> None:
    """At 0 °C it has its full size."""
    first = added({"cold_drag_A": 0.02}, 0.0, ambient_degC=ambient_degC)
    assert first == pytest.approx(0.02 * np.exp(-ambient_degC / 10))


def test_a_warmer_magnet_needs_more_current_for_the_same_torque() -> None:
    """The torque constant changes relative to 20 °C."""
    base = {"noise": SensorNoise.none(), "ambient_degC": 30.0}
    world = even(**base, hidden={"torque_constant_per_degC": -0.01})
    current = after(world, 0.0).motor_current_A
    assert world.truth is not None
    wanted = motor_current(world.truth.torque_Nm / 0.9, CREEP, world.scenario.drivetrain)
    assert current == pytest.approx(wanted)


def test_a_ripple_has_its_order_and_amplitude() -> None:
    """Two cycles a wheel turn by default: zero at angles 0 and π/2, the amplitude at π/4."""
    world, plain = even(hidden={"ripple_A": 0.005}), even()
    found = []
    for k in range(9):
        time_s = k * (np.pi / 8) / 0.3
        read, other = world.measure(time_s, CREEP), plain.measure(time_s, CREEP)
        found.append(float(read.motor_current_A[0] - other.motor_current_A[0]))
    assert np.array(found) == pytest.approx(0.005 * np.sin(2 * np.arange(9) * np.pi / 8), abs=1e-4)


def test_grade_resistance_is_the_weight_s_share_along_the_slope() -> None:
    """Six wheels share it; factor 0 switches it off."""
    slope = {"pitch_deg": 5.0}
    with_it, without = (even(ground=slope, hidden={"grade_resistance": factor}) for factor in (1.0, 0.0))
    for world in (with_it, without):
        after(world, 1.0)
    assert with_it.truth is not None
    assert without.truth is not None
    share = 30 * 9.80665 * np.sin(np.radians(5.0)) * RADIUS_M / 6
    assert with_it.truth.torque_Nm - without.truth.torque_Nm == pytest.approx(share)


def test_motors_warm_by_their_current_with_a_time_constant_of_ten_minutes() -> None:
    """120 °C per ampere above ambient, from ambient at the start."""
    world = even(hidden={"grade_resistance": 0.0})
    first = world.measure(0.0, CREEP)
    assert first.motor_temperature_degC == pytest.approx(15.0)
    later = world.measure(600.0, CREEP)
    rise = 120.0 * later.motor_current_A
    assert later.motor_temperature_degC - 15.0 == pytest.approx(rise * (1 - np.exp(-1)), rel=1e-3)


def test_the_supply_sags_by_its_resistance() -> None:
    """24.6 V less 0.8 Ω times the sum of all currents, also when driving backwards."""
    for speed in (CREEP, -CREEP):
        read = even().measure(0.0, speed)
        assert read.bus_voltage_V == pytest.approx(24.6 - 0.8 * np.abs(read.motor_current_A).sum())


def test_slip_and_yaw_follow_from_the_wheels_speeds() -> None:
    """Slip 2.5 % on level ground, 0.3 times the sine of the pitch more uphill; 60 % of the difference becomes yaw."""
    level, up = even(), even(ground={"pitch_deg": 10.0})
    for world, slip in ((level, 0.025), (up, 0.025 + 0.3 * np.sin(np.radians(10)))):
        read = world.measure(0.0, CREEP)
        assert read.ground_speed_m_s == pytest.approx(0.3 * RADIUS_M * (1 - slip))
        assert world.truth is not None
        assert world.truth.slip == pytest.approx(slip)
    turn = even().measure(0.0, CREEP * np.array([0.8, 1.2] * 3))
    difference, track = 0.4 * 0.3 * RADIUS_M, Rover().track_m
    assert turn.yaw_rate_rad_s == pytest.approx(0.6 * difference / track)
    assert turn.hub_speed_m_s[1] - turn.hub_speed_m_s[0] == pytest.approx(turn.yaw_rate_rad_s * track)
    assert turn.ground_speed_m_s == pytest.approx(0.3 * RADIUS_M * 0.975)


def test_torque_fades_below_the_lowest_wheel_speed() -> None:
    """Half of 0.05 rad/s gives half the torque; slip is 0 there."""
    assert virtual_rover.STANDSTILL_RAD_S == 0.05
    worlds = [even(), even()]
    for world, wheel_speed in zip(worlds, (0.05, 0.025), strict=True):
        world.measure(0.0, np.full(6, wheel_speed * RATIO))
    full, half = (world.truth for world in worlds)
    assert full is not None
    assert half is not None
    assert half.slip == pytest.approx(0.0)
    assert full.slip == pytest.approx(0.025)
    level = even(motion={"slip": 0.0})
    level.measure(0.0, np.full(6, 0.05 * RATIO))
    assert level.truth is not None
    assert half.torque_Nm == pytest.approx(0.5 * level.truth.torque_Nm)


def test_the_slope_is_constant_plus_a_wave() -> None:
    """The wave's amplitude and length are the scenario's; roll has twice the wave length."""
    world = VirtualWorld(
        Scenario.model_validate(
            {
                "noise": SensorNoise.none(),
                "ground": {"pitch_deg": 2.0, "roll_deg": -1.0, "wave_deg": 3.0, "wave_length_m": 0.5},
            }
        )
    )
    reads = [world.measure(0.1 * k, CREEP) for k in range(1000)]
    pitch, roll = np.degrees([read.pitch_rad for read in reads]), np.degrees([read.roll_rad for read in reads])
    assert (pitch.max(), pitch.min()) == pytest.approx((5.0, -1.0), abs=0.02)
    assert (roll.max(), roll.min()) == pytest.approx((2.0, -4.0), abs=0.02)
    distance = np.cumsum([0.0, *(0.1 * read.ground_speed_m_s for read in reads[:-1])])
    for values, length in ((pitch - 2.0, 0.5), (roll + 1.0, 1.0)):
        crossings = np.flatnonzero((values[:-1] < 0) & (values[1:] >= 0))
        assert np.diff(distance[crossings]).mean() == pytest.approx(length, rel=0.01)


@pytest.mark.parametrize(
    ("key", "read", "std"),
    [
        ("angle_std_deg", lambda read: np.degrees(read.pitch_rad), 0.05),
        ("angle_std_deg", lambda read: np.degrees(read.roll_rad), 0.05),
        ("yaw_rate_std_deg_s", lambda read: np.degrees(read.yaw_rate_rad_s), 0.02),
        ("ground_speed_relative_std", lambda read: read.ground_speed_m_s / (0.3 * RADIUS_M * 0.975), 0.002),
        ("current_std_A", lambda read: read.motor_current_A[4], 0.001),
    ],
)
def test_a_sensor_has_its_own_noise(key: str, read: Any, std: float) -> None:
    """Its standard deviation is the scenario's key alone."""
    assert getattr(SensorNoise(), key) == std
    noise = SensorNoise.none().model_copy(update={key: std})
    world = VirtualWorld(Scenario.model_validate({"noise": noise.model_dump(), "ground": {"wave_deg": 0.0}}))
    values = np.array([read(world.measure(0.5 * k, CREEP)) for k in range(800)])
    trend = np.polynomial.Polynomial.fit(np.arange(800), values, 2)(np.arange(800))
    assert np.std(values - trend) == pytest.approx(std, rel=0.1)


def bearing(wheel: int) -> dict[str, float]:
    """Return the table of a bearing's drag."""
    return {"wheel": wheel, "from_s": 0.0, "current_A": 0.0}


@pytest.mark.parametrize(
    ("table", "key", "allowed", "refused"),
    [
        ("ground", "pitch_deg", (-30.0, 30.0), (-30.1, 30.1)),
        ("ground", "roll_deg", (-30.0, 30.0), (-30.1, 30.1)),
        ("ground", "wave_deg", (0.0, 10.0), (-0.1, 10.1)),
        ("ground", "wave_length_m", (0.1,), (0.0,)),
        ("motion", "slip", (-0.49, 0.89), (-0.5, 0.9)),
        ("motion", "centre_of_mass_m", (0.1,), (0.0,)),
        ("noise", "terrain_share", (0.0, 1.0), (-0.01, 1.01)),
        ("noise", "drop_depth", (0.0, 1.0), (-0.01, 1.01)),
        ("hidden", "bearing_drag", (bearing(1), bearing(6)), (bearing(0), bearing(7))),
    ],
)
def test_a_key_has_its_limits(table: str, key: str, allowed: tuple[Any, ...], refused: tuple[Any, ...]) -> None:
    """The limits themselves are allowed where the physics allows them."""
    for value in allowed:
        Scenario.model_validate({table: {key: value}})
    for value in refused:
        with pytest.raises(ValidationError):
            Scenario.model_validate({table: {key: value}})


def test_a_soil_without_a_name_is_called_by_its_strength() -> None:
    """A known soil has its name of Table 1."""
    assert Stretch(soil=SOILS["lete-sand"]).name == "lete-sand"
    other = SOILS["lete-sand"].model_copy(update={"cohesion_Pa": 1234.0, "friction_angle_deg": 30.5})
    assert Stretch(soil=other).name == "c = 1234 Pa, φ = 30.5°"
    with pytest.raises(ValidationError, match=r"no soil is called 'cheese'; known are .*lete-sand"):
        Scenario.model_validate({"ground": {"stretches": [{"soil": "cheese"}]}})
