"""A reading that rings is unexplained; what is late keeps its name, and what is no dynamics is none."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import mass_on_spring
import numpy as np
import pytest
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.empirical.written import with_curves
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.regression.groups.lagged_groups import LAGGED
from regolithd.calibration.mismatch.report.labels import verdict_sentence

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.calibration.mismatch.result import Comparison

Array = NDArray[np.float64]
COUNT, STEP_S, FINE = 4000, 0.25, 50
TIME_S = STEP_S * np.arange(COUNT)


class Stand(Simulation):
    """The thrust of a propeller: its speed squared."""

    channel, unit = "thrust_N", "N"
    inputs = ("speed_rpm",)
    parameters: ClassVar = {"thrust_N": Prior(10.0, 0.5, "N")}
    without_effects = ("wheel-angle-ripple",)
    one_way = True

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the thrust."""
        return values["thrust_N"] * (inputs["speed_rpm"] / 3000) ** 2

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the speed."""
        return {"wheel_speed": inputs["speed_rpm"]}


def thrust(speed: Array) -> Array:
    """Return the true thrust."""
    return np.asarray(10.2 * (speed / 3000) ** 2)


def driven(random: np.random.Generator) -> Array:
    """Return a speed that goes to another value every 3 to 10 s, within a second."""
    wanted = np.repeat(random.uniform(1800, 4200, COUNT), random.integers(12, 40, COUNT))[:COUNT]
    found = np.array(wanted)
    for k in range(1, COUNT):
        found[k] = found[k - 1] + 0.4 * (wanted[k] - found[k - 1])
    return found


def behind(values: Array, frequency_Hz: float, damping: float) -> Array:
    """Return values behind a mass on a spring, integrated in small steps."""
    fine = np.interp(np.arange(COUNT * FINE) * STEP_S / FINE, TIME_S, values)
    return mass_on_spring.behind(fine, FINE, STEP_S / FINE, frequency_Hz, damping)


def noise(random: np.random.Generator, memory: float = 0.8) -> Array:
    """Return noise with a memory, of a tenth of the mean thrust."""
    found = random.normal(size=COUNT)
    for k in range(1, COUNT):
        found[k] = memory * found[k - 1] + np.sqrt(1 - memory**2) * found[k]
    return np.asarray(found)


def compared(measured: Array, speed: Array) -> Comparison:
    """Return the comparison of a thrust with the speed as recorded."""
    return compare(from_columns({"t_s": TIME_S, "speed_rpm": speed, "thrust_N": measured}), Stand())


@pytest.mark.parametrize(("frequency_Hz", "damping"), [(0.2, 0.15), (0.3, 0.12), (0.6, 0.08)])
def test_a_reading_that_rings_is_unexplained(frequency_Hz: float, damping: float) -> None:
    """The noise's memory does not take it up, and it says that it is the past which matters; it has no curve."""
    random = np.random.default_rng(round(10 * frequency_Hz))
    speed = driven(random)
    rings = thrust(speed) + 0.5 * (behind(thrust(speed), frequency_Hz, damping) - thrust(speed))
    found = compared(rings + noise(random), speed)
    (place,) = found.answer.unexplained
    assert found.answer.effects == ()
    assert place.covariate in LAGGED
    assert place.curve is None
    assert place.to_s - place.from_s > 0.8 * TIME_S[-1]
    assert "depends on the past of the" in verdict_sentence(found.answer)
    assert any("how thrust_N follows in time: a late reading, a filter" in note for note in found.answer.notes)
    with pytest.raises(SimulationError, match="follows what was before"):
        with_curves(found.answer, found.evidence)


@pytest.mark.parametrize("memory", [0.0, 0.8, 0.97])
def test_noise_with_a_memory_is_no_dynamics(memory: float) -> None:
    """Whatever its memory."""
    random = np.random.default_rng(3)
    speed = driven(random)
    answer = compared(thrust(speed) + noise(random, memory), speed).answer
    assert answer.verdict == "consistent"
    assert not any("follows in time" in note for note in answer.notes)


@pytest.mark.parametrize("late", ["filter", "dead time"])
def test_what_is_late_keeps_its_name(late: str) -> None:
    """A first-order filter and a dead time are laws; nothing is unexplained beside them."""
    random = np.random.default_rng(4)
    speed = driven(random)
    course = thrust(speed)
    if late == "filter":
        fine, found = np.interp(np.arange(COUNT * FINE) * STEP_S / FINE, TIME_S, course), [course[0]]
        for value in fine[1:].tolist():
            found.append(found[-1] + (value - found[-1]) * STEP_S / FINE / 0.9)
        shown = np.array(found[::FINE])
    else:
        shown = np.interp(TIME_S - 0.8, TIME_S, course)
    answer = compared(shown + noise(random), speed).answer
    assert [effect.name for effect in answer.effects] == ["sensor-delay"]
    assert answer.unexplained == ()


@pytest.mark.parametrize("readings", [-0.6, 0.6])
def test_less_than_a_reading_late_or_early_is_no_dynamics(readings: float) -> None:
    """A sampled input does not say what it was between two readings."""
    random = np.random.default_rng(5)
    speed = driven(random)
    shown = np.interp(TIME_S - readings * STEP_S, TIME_S, thrust(speed))
    places = compared(shown + noise(random), speed).answer.unexplained
    assert LAGGED.isdisjoint(place.covariate for place in places)


def test_a_noisy_input_is_no_dynamics() -> None:
    """The past of a noisy prediction tells the true one as well as what comes later does."""
    random = np.random.default_rng(6)
    speed = driven(random)
    recorded = speed + 150 * random.normal(size=COUNT)
    places = compared(thrust(speed) + 0.3 * noise(random), recorded).answer.unexplained
    assert LAGGED.isdisjoint(place.covariate for place in places)
