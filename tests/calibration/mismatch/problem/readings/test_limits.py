"""Where a prediction is at a limit of the machine, and what does not show there."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare, direction_of, from_columns
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.online.laws import law_columns, laws_of
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.readings.limits import FEWEST_AT_LIMIT, at_limit

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROWS, LIMIT_A = 4000, 6.0


class Drive(Simulation):
    """A drive that turns an inertia and a load, and whose current is limited."""

    channel, unit = "current_A", "A"
    inputs = ("speed_rad_s", "acceleration_rad_s2", "load_Nm")
    parameters: ClassVar = {"constant_Nm_A": Prior(0.5, 0.01, "N·m/A"), "inertia_kg_m2": Prior(0.2, 0.01, "kg·m²")}
    limit_A = LIMIT_A

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current that load and inertia need, as far as it goes."""
        load = direction_of(inputs["speed_rad_s"]) * inputs["load_Nm"]
        needed = (load + values["inertia_kg_m2"] * inputs["acceleration_rad_s2"]) / values["constant_Nm_A"]
        return np.clip(needed, -self.limit_A, self.limit_A)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and acceleration."""
        return {"wheel_speed": inputs["speed_rad_s"], "wheel_acceleration": inputs["acceleration_rad_s2"]}


class Unlimited(Drive):
    """The same without a limit."""

    limit_A = 1e9


def recorded(drag: float, seed: int = 5) -> dict[str, Array]:
    """Return a speed-controlled drive, whose controller saturates while the speed changes, with a drag of ω²."""
    rng = np.random.default_rng(seed)
    step_s, speed, wanted = 0.1, 0.0, 0.0
    found: dict[str, list[float]] = {name: [] for name in (*Drive.inputs, "current_A")}
    for row in range(ROWS):
        if row % 60 == 0:
            wanted, load = float(rng.choice([-1, 1]) * rng.uniform(10, 60)), float(rng.uniform(0.2, 1.5))
        against = float(np.sign(speed)) * (load + drag * speed**2)
        current = float(np.clip((against + 0.8 * (wanted - speed)) / 0.5, -LIMIT_A, LIMIT_A))
        acceleration = (0.5 * current - against) / 0.2
        for name, value in zip(found, (speed, acceleration, load, current), strict=True):
            found[name].append(value)
        speed += step_s * acceleration
    columns = {name: np.array(values) for name, values in found.items()}
    columns["current_A"] = columns["current_A"] + rng.normal(0, 0.1, ROWS)
    return {"t_s": np.arange(ROWS) * step_s, **columns}


def test_a_limit_is_where_no_parameter_moves_the_largest_current() -> None:
    """Both ways; not where the current is just below it, and nowhere without a limit."""
    columns = recorded(0.0003)
    problem = build_problem(from_columns(columns), Drive())
    limited = at_limit(problem)
    assert limited.sum() >= FEWEST_AT_LIMIT
    assert set(np.abs(problem.prediction[limited]).tolist()) == {LIMIT_A}
    assert {-LIMIT_A, LIMIT_A} <= set(problem.prediction[limited].tolist())
    assert not problem.tangent("inertia_kg_m2")[limited].any()
    assert not at_limit(build_problem(from_columns(columns), Unlimited())).any()


@pytest.mark.parametrize("offset_A", [0.0, 0.5])
def test_the_smallest_current_of_an_unloaded_machine_is_no_limit(offset_A: float) -> None:
    """Nothing of the load is left there for a parameter to move, and friction acts all the same."""

    class Unloaded(Drive):
        def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
            return inputs["load_Nm"] / values["constant_Nm_A"] + offset_A

    columns = recorded(0.0)
    columns["load_Nm"] = np.where(np.arange(ROWS) % 3 == 0, 0.0, columns["load_Nm"])
    assert not at_limit(build_problem(from_columns(columns), Unloaded())).any()


def test_a_drag_is_named_alone_beside_a_limited_current() -> None:
    """Added to the limited current, it would be taken from readings that are right, and an inertia explain that."""
    # While it brakes at the limit, the simulation without the drag would take more current than there is.
    answer = compare(from_columns(recorded(0.0005)), Drive()).answer
    assert [effect.name for effect in answer.effects] == ["quadratic-drag"]
    assert answer.verdict == "missing-physics"
    coefficient = answer.effects[0].parameters["quadratic_coefficient"]
    assert coefficient.low < 0.001 < coefficient.high
    inertia = {each.name: each for each in answer.parameters}["inertia_kg_m2"]
    assert inertia.low < 0.2 < inertia.high


def test_what_is_monitored_does_not_show_at_a_limit() -> None:
    """The columns of `regolithd monitor` are those of the whole comparison there: 0."""
    problem = build_problem(from_columns(recorded(0.0003)), Drive())
    laws = laws_of(problem, library())
    columns = law_columns(problem, laws)
    loads = [law.candidate.loads for law in laws]
    limited = at_limit(problem)
    assert limited.any()
    assert any(loads)
    assert not columns[loads][:, limited].any()
    assert columns[~np.array(loads)][:, limited].any()
