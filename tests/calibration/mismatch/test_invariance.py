"""The answer is the same in other units, zeros, units of time, names of axes and orders of rows.

`make mutations` tries a thousand combinations (INVARIANCES=1000); the suite tries a few.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from regolithd.calibration.mismatch import Prior, Simulation, compare

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch import Candidate
    from regolithd.calibration.mismatch.answer import Answer

    Array = NDArray[np.float64]

EXAMPLES = int(os.environ.get("INVARIANCES", "6"))
LOOKED_FOR = {
    "coulomb-friction",
    "viscous-friction",
    "cold-lubricant-friction",
    "rotor-inertia",
    "current-sensor-bias",
    "sensor-delay",
}
TORQUE = {"N·m": 1.0, "mN·m": 1e3, "kN·m": 1e-3, "lbf·in": 8.850746}
SPEED = {"rad": 1.0, "deg": 57.29578, "turn": 0.15915494}
TEMPERATURE = {"degC": (1.0, 0.0), "K": (1.0, 273.15), "degF": (1.8, 32.0)}
TIME = {"t_s": 1.0, "t_ms": 1e3, "t_us": 1e6, "t_min": 1 / 60, "t_h": 1 / 3600}
AXES = (("elbow", "wrist"), ("wrist", "elbow"), ("1", "2"), ("Achse Ä", "b c"))


@dataclass(frozen=True)
class Writing:
    """How a recording is written: units, zeros, names and order."""

    torque: str = "N·m"
    speed: str = "rad"
    temperature: str = "degC"
    time: str = "t_s"
    origin_s: float = 0.0
    axes: tuple[str, str] = AXES[0]
    order: int | None = None


WRITINGS = st.builds(
    Writing,
    torque=st.sampled_from(sorted(TORQUE)),
    speed=st.sampled_from(sorted(SPEED)),
    temperature=st.sampled_from(sorted(TEMPERATURE)),
    time=st.sampled_from(sorted(TIME)),
    origin_s=st.integers(0, 10**6).map(float),
    axes=st.sampled_from(AXES),
    order=st.integers(0, 2**31),
)


def arm(writing: Writing) -> Simulation:
    """Return the simulation of two joints, in the units of a recording."""
    factor, moved = TORQUE[writing.torque], SPEED[writing.speed]
    degree, zero = TEMPERATURE[writing.temperature]

    class Arm(Simulation):
        channel, unit = "torque", writing.torque
        wheel_column = "axis"
        inputs = ("acceleration",)
        covariate_labels: ClassVar = {"wheel_speed": f"joint speed ({writing.speed}/s)"}
        parameters: ClassVar = {"inertia": Prior(0.5 * factor / moved, 0.02 * factor / moved, "1")}

        def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
            return values["inertia"] * inputs["acceleration"]

        def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
            celsius = (inputs["oil_temperature"] - zero) / degree
            # The library's law of grease is in °C; what is read is in the recording's unit.
            return {"wheel_speed": inputs["speed"], "temperature": celsius}

        def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
            return [each for each in library if each.name in LOOKED_FOR]

    return Arm()


@cache
def readings() -> dict[str, NDArray[np.float64]]:
    """Return two joints, of which the second has Coulomb friction and both warm up, shape (time, joint)."""
    rng, time_s = np.random.default_rng(4), 0.05 * np.arange(800)[:, None]
    rate = np.array([0.7, 0.9])
    speed = np.sin(rate * time_s) + 0.6 * np.sin(2.1 * rate * time_s)
    acceleration = np.gradient(speed, time_s[:, 0], axis=0)
    friction = np.array([0.0, 0.12]) * np.sign(speed)
    return {
        "time_s": np.repeat(time_s, 2, axis=1),
        "speed": speed,
        "acceleration": acceleration,
        "oil_temperature": 20 + 15 * (1 - np.exp(-time_s / 20)) + rng.normal(0, 0.2, speed.shape),
        "torque": 0.5 * acceleration + friction + rng.normal(0, 0.08, speed.shape),
    }


def written(writing: Writing) -> dict[str, NDArray[np.generic]]:
    """Return the readings as a table."""
    found, moved = readings(), SPEED[writing.speed]
    degree, zero = TEMPERATURE[writing.temperature]
    table: dict[str, NDArray[np.generic]] = {
        writing.time: (found["time_s"] + writing.origin_s).ravel() * TIME[writing.time],
        "axis": np.tile(np.array(writing.axes), len(found["time_s"])),
        "speed": moved * found["speed"].ravel(),
        "acceleration": moved * found["acceleration"].ravel(),
        "oil_temperature": degree * found["oil_temperature"].ravel() + zero,
        "torque": TORQUE[writing.torque] * found["torque"].ravel(),
    }
    if writing.order is None:
        return table
    order = np.random.default_rng(writing.order).permutation(found["torque"].size)
    return {name: values[order] for name, values in table.items()}


@cache
def as_it_was() -> Answer:
    """Return the answer to the plain writing."""
    return compare(written(Writing()), arm(Writing())).answer


@settings(max_examples=EXAMPLES, deadline=None)
@given(writing=WRITINGS)
def test_the_answer_does_not_depend_on_how_the_recording_is_written(writing: Writing) -> None:
    """Names, joints, sizes and intervals are the same; what has the torque's unit is in the recording's."""
    expected = as_it_was()
    (known,) = expected.effects
    assert (known.name, known.wheels) == ("coulomb-friction", ("wrist",))
    answer = compare(written(writing), arm(writing)).answer
    assert answer.verdict == expected.verdict
    (effect,) = answer.effects
    assert (effect.name, effect.wheels) == (known.name, (writing.axes[1],))
    size, stated = effect.parameters["coulomb_current"], known.parameters["coulomb_current"]
    width = stated.high - stated.low
    factor = TORQUE[writing.torque]
    assert size.unit == writing.torque
    for name in ("value", "low", "high"):
        assert getattr(size, name) / factor == pytest.approx(getattr(stated, name), abs=0.05 * width)
    relative, before = effect.parameters["relative_size"], known.parameters["relative_size"]
    assert relative.value == pytest.approx(before.value, rel=1e-2)
    assert answer.fit.held_out_rmse_after / factor == pytest.approx(expected.fit.held_out_rmse_after, rel=1e-2)
    smallest = {each.name: each.smallest_detectable for each in expected.sensitivity}
    for each in answer.sensitivity:
        assert each.smallest_detectable / factor == pytest.approx(smallest[each.name], rel=0.05)


def heated(unit: str) -> tuple[dict[str, Array], Simulation]:
    """Return a plate's temperature in a unit, on which a fan acts that the simulation does not know."""
    degree, zero = TEMPERATURE[unit]
    rng, time_s = np.random.default_rng(2), 5.0 * np.arange(900)
    power = np.repeat(rng.uniform(10, 60, 30), 30)
    fan = np.repeat(rng.uniform(0, 12, 45), 20)
    celsius = 20 + 0.8 * power - 6 * np.sin(fan / 3) + rng.normal(0, 1, len(time_s))

    class Plate(Simulation):
        channel, inputs = "plate_temperature", ("power_W",)
        parameters: ClassVar = {"resistance": Prior(0.8 * degree, 0.02 * degree, "1")}

        def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
            return degree * 20 + zero + values["resistance"] * inputs["power_W"]

        def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
            return {"voltage": inputs["fan_V"]}

    Plate.unit = unit
    table = {"t_s": time_s, "power_W": power, "fan_V": fan, "plate_temperature": degree * celsius + zero}
    return table, Plate()


@cache
def said_of_the_plate(unit: str) -> Answer:
    """Return the answer in one unit."""
    table, simulation = heated(unit)
    return compare(table, simulation).answer


@pytest.mark.parametrize("unit", ["K", "degF"])
def test_the_zero_of_a_predicted_temperature_means_nothing(unit: str) -> None:
    """In kelvin and in degrees Fahrenheit as in degrees Celsius: the same verdict, covariate and share."""
    expected, answer = said_of_the_plate("degC"), said_of_the_plate(unit)
    assert expected.verdict == answer.verdict == "unexplained"
    (known,), (found,) = expected.unexplained, answer.unexplained
    assert known.covariate == found.covariate == "voltage"
    assert found.share_of_residual == pytest.approx(known.share_of_residual, rel=1e-3)
    degree = TEMPERATURE[unit][0]
    assert answer.fit.noise_floor_rmse / degree == pytest.approx(expected.fit.noise_floor_rmse, rel=1e-3)
