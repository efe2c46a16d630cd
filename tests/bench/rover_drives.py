"""Recordings of five minutes for the tests: the stated simulation itself, driven, with noise and whatever a test adds.

They test the machinery; whether physics of another hand is found is what `regolithd prove` is for.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.simulation.rover_wheel import RoverWheel

Array = NDArray[np.float64]

TABLES: dict[str, Any] = {
    "simulation": {"model": "rover-wheel"},
    "drivetrain": {"gain_relative_std": 0.02},
    "soil": {
        "cohesion_Pa": 1220.0,
        "friction_angle_deg": 30.3,
        "shear_modulus_m": 0.0116,
        "sinkage_exponent": 0.79,
        "k_c_kN": 102.0,
        "k_phi_kN": 5301.0,
        "cohesion_relative_std": 0.03,
        "friction_angle_relative_std": 0.02,
    },
    "sensors": {
        "load_relative_std": 0.02,
        "ground_speed_relative_std": 0.004,
        "pitch_std_rad": 0.005,
        "roll_std_rad": 0.005,
        "yaw_rate_std_rad_s": 0.001,
        "temperature_std_degC": 0.5,
    },
}


def simulation() -> RoverWheel:
    """Return the stated simulation."""
    return RoverWheel.from_tables(TABLES)


def columns(
    seed: int = 0, *, length_s: float = 300.0, speed: float | None = None, noise: float = 0.2
) -> dict[str, Array]:
    """Return a drive as a long table, with nothing missing from the simulation; `speed` [rad/s] for a constant one."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, length_s, 0.2)
    pieces = len(t) // 75 + 1
    steps = rng.uniform(0.08, 0.45, pieces) * rng.choice([1, 1, -1], pieces)
    wheel_speed = np.repeat(steps, 75)[: len(t)] if speed is None else np.full(len(t), speed)
    still = speed is not None
    pitch = np.zeros(len(t)) if still else 0.1 * np.sin(t / 37)
    roll = np.zeros(len(t)) if still else 0.06 * np.sin(t / 53 + 1)
    slip = 0.03 if still else 0.03 + 0.8 * np.abs(pitch)
    load = 49 * (1 + rng.normal(0, 0.06, (len(t), 6))) + 40 * np.outer(pitch, [-1, -1, 0, 0, 1, 1])
    warm = np.zeros(len(t)) if still else 15 * np.sin(t / 130) + 4
    turn = np.where((t % 150 > 110) & (t % 150 < 135), rng.choice([-0.02, 0.02]), 0.0)
    motor = np.broadcast_to(1400 * wheel_speed[:, None], (len(t), 6))
    ground = 0.075 * wheel_speed * (1 - slip)
    table = {
        "t_s": np.repeat(t, 6),
        "wheel": np.tile(np.arange(1.0, 7.0), len(t)),
        "motor_speed_rad_s": motor.ravel(),
        "load_N": load.ravel(),
        "ground_speed_m_s": np.repeat(ground, 6),
        "pitch_rad": np.repeat(pitch, 6),
        "roll_rad": np.repeat(roll, 6),
        "yaw_rate_rad_s": np.repeat(np.zeros(len(t)) if still else turn, 6),
        "motor_temperature_degC": np.repeat(warm, 6),
        "bus_voltage_V": np.repeat(24 + 0.5 * np.sin(t / 91), 6),
    }
    sim = simulation()
    prepared = sim.prepare(from_columns(table))
    values = {name: prior.value for name, prior in sim.parameters.items()}
    current = sim.predict({**prepared.channels, "t_s": prepared.channels["slip"]}, values)
    correlated = rng.normal(0, 1, current.shape)
    for k in range(1, len(correlated)):
        correlated[k] = 0.6 * correlated[k - 1] + 0.8 * correlated[k]
    current = current + noise * np.nanmean(np.abs(current)) * correlated
    table["motor_current_A"] = current.ravel()
    table["load_N"] = table["load_N"] * (1 + rng.normal(0, 0.02, len(t) * 6))
    table["ground_speed_m_s"] = table["ground_speed_m_s"] * (1 + rng.normal(0, 0.004, len(t) * 6))
    return table


def recording(seed: int = 0, **drive: Any) -> Recording:  # what `columns` takes
    """Return a drive as a recording."""
    return from_columns(columns(seed, **drive))
