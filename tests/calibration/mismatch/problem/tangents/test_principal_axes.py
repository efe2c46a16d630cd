"""Tangents of a simulation that switches: an oven whose fan has a hysteresis."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare, from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.tangents.principal_axes import switches, tangents_where_it_switches

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Answer

    Array = NDArray[np.float64]

ROWS, STEP_s = 4000, 2.0
ON_degC, OFF_degC = 80.0, 60.0


class Oven(Simulation):
    """A heated zone; its fan runs from 80 °C until it has cooled to 60 °C. Only ratios of P, h and C show."""

    channel, unit = "zone_degC", "°C"
    inputs = ("duty", "ambient_degC")
    parameters: ClassVar = {
        "P": Prior(800.0, 40.0, "W"),
        "h": Prior(6.0, 0.4, "W/K"),
        "C": Prior(3000.0, 200.0, "J/K"),
        "fan": Prior(1.2, 0.15, "1"),
    }

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the zone's temperature, integrated from that of the ambient air."""
        duty, ambient = inputs["duty"][:, 0], inputs["ambient_degC"][:, 0]
        zone, runs, found = float(ambient[0]), False, []
        for heat, air in zip(values["P"] * duty, ambient, strict=True):
            found.append(zone)
            runs = zone > ON_degC or (runs and zone >= OFF_degC)
            loss = values["h"] * (1 + values["fan"] * self.blows * runs) * (zone - air)
            zone += STEP_s * float(heat - loss) / values["C"]
        return np.array(found)[:, None]

    blows = 1.0

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the duty of the heater."""
        return {"duty": inputs["duty"]}


class Still(Oven):
    """The same without a fan."""

    blows = 0.0


def recorded(seed: int) -> tuple[dict[str, Array], dict[str, float]]:
    """Return an oven with parameters drawn from their priors and autocorrelated noise of 1 K, and the parameters."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(ROWS) * STEP_s
    duty = np.repeat(rng.uniform(0, 1, ROWS // 80 + 1), 80)[:ROWS]
    ambient = 20 + 3 * np.sin(2 * np.pi * time_s / 5000)
    truth = {name: float(rng.normal(prior.value, prior.std)) for name, prior in Oven.parameters.items()}
    inputs = {"duty": duty[:, None], "ambient_degC": ambient[:, None]}
    zone = Oven().predict(inputs, truth)[:, 0]
    slow = np.zeros(ROWS)
    for row in range(1, ROWS):
        slow[row] = 0.9 * slow[row - 1] + rng.normal(0, 0.44)
    noise = 0.7 * slow + rng.normal(0, 0.7, ROWS)
    return {"t_s": time_s, "duty": duty, "ambient_degC": ambient, "zone_degC": zone + noise}, truth


def test_a_fan_with_a_hysteresis_switches_and_a_smooth_law_does_not() -> None:
    """Difference quotients to both sides tell the two apart; a smooth simulation keeps its difference quotients."""
    columns, _ = recorded(0)
    problem = build_problem(from_columns(columns), Oven())
    assert all(switches(problem, name) for name in Oven.parameters)
    smooth = build_problem(from_columns(columns), Still())
    assert not any(switches(smooth, name) for name in Oven.parameters)
    assert len(tangents_where_it_switches(smooth)) == 0
    assert np.array_equal(smooth.tangent("C"), smooth.difference_quotient("C"))


def test_parameters_of_which_only_ratios_show_have_tangents_that_cancel() -> None:
    """P, h and C that are all larger by a hundredth change nothing; their difference quotients would say they do."""
    problem = build_problem(from_columns(recorded(0)[0]), Oven())
    scaled = {name: problem.values[name] for name in ("P", "h", "C")}
    largest = max(float(np.std(value * problem.tangent(name))) for name, value in scaled.items())
    together = sum(value * problem.tangent(name) for name, value in scaled.items())
    apart = sum(value * problem.difference_quotient(name) for name, value in scaled.items())
    assert float(np.std(together)) < 0.02 * largest
    assert float(np.std(apart)) > 0.05 * largest


@pytest.fixture(scope="module")
def answers() -> list[tuple[Answer, dict[str, float]]]:
    """Compare six ovens; the first of them has a minimum of the squares with three times the noise."""
    found = []
    for seed in (8, 0, 1, 2, 4, 5):
        columns, truth = recorded(seed)
        found.append((compare(from_columns(columns), Oven()).answer, truth))
    return found


def test_intervals_of_what_only_the_priors_tell_are_as_wide_as_these(
    answers: list[tuple[Answer, dict[str, float]]],
) -> None:
    """Three of their 24 may miss the truth by chance; by difference quotients from the stated values alone, 18 do."""
    parameters = [(each, truth[each.name]) for answer, truth in answers for each in answer.parameters]
    assert {answer.verdict for answer, _ in answers} == {"consistent"}
    assert sum(each.low <= true <= each.high for each, true in parameters) >= 21
    for each, _ in parameters:
        if each.name != "fan":
            assert (each.high - each.low) / 3.29 > 0.35 * each.prior_std


def test_the_fit_does_not_end_where_the_fan_runs_at_the_wrong_times(
    answers: list[tuple[Answer, dict[str, float]]],
) -> None:
    """From the stated values alone it ends at three times the noise, with a fan far out of its interval."""
    answer, truth = answers[0]
    found = {each.name: each for each in answer.parameters}
    assert found["fan"].value == pytest.approx(truth["fan"], rel=0.02)
    assert answer.fit.held_out_rmse_after < 1.1


class Freezing(Simulation):
    """A torque in proportion to a load, with a step of 3 N·m in one reading as soon as the load has a greater share."""

    channel, unit = "torque_Nm", "N·m"
    inputs = ("load_kg", "speed_rad_s")
    parameters: ClassVar = {"share": Prior(1.0, 0.1, "N·m/kg"), "drag": Prior(0.5, 0.05, "N·m s/rad")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the torque."""
        torque = values["share"] * inputs["load_kg"] + values["drag"] * inputs["speed_rad_s"]
        torque[1000] += 3.0 * (values["share"] > 1.0)
        return torque

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the load."""
        return {"load": inputs["load_kg"]}


def test_a_change_over_that_no_axis_agrees_on_does_not_grow() -> None:
    """Over the standard deviation of what is known well, a step is a steep slope, and makes that seem known better."""
    random = np.random.default_rng(3)
    load, speed = random.uniform(1, 2, 2000), random.uniform(0, 3, 2000)
    columns = {"t_s": 0.1 * np.arange(2000), "load_kg": load, "speed_rad_s": speed}
    columns["torque_Nm"] = 1.02 * load + 0.49 * speed + random.normal(0, 0.1, 2000)
    problem = build_problem(from_columns(columns), Freezing())
    assert switches(problem, "share")
    share, drag = tangents_where_it_switches(problem)[:, :, 0]
    np.testing.assert_allclose(np.delete(share, 1000), np.delete(load, 1000))
    assert share[1000] == pytest.approx(load[1000] + 3.0 / 0.2)
    np.testing.assert_allclose(drag, speed)
