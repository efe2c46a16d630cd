"""A simulation that is stateful and not linear in its parameters is calibrated where it has been run."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.calibration.linearised import worse_than_stated
from regolithd.calibration.mismatch.calibration.step import Step
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.regression.equations import free_parameter_equations

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.problem.problem import Problem

    Array = NDArray[np.float64]


class Tank(Simulation):
    """A tank that drains through an orifice (Torricelli): level from inflow."""

    channel, unit = "level_m", "m"
    inputs = ("inflow_m3_s",)
    parameters: ClassVar = {"area_m2": Prior(0.5, 0.02, "m²"), "outlet": Prior(0.010, 0.0004, "m²·⁵/s")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Integrate the level by Euler steps of one second."""
        inflow, level = inputs["inflow_m3_s"], np.empty_like(inputs["inflow_m3_s"])
        now = np.ones(inflow.shape[1])
        for row, flow in enumerate(inflow):
            level[row] = now
            now = np.maximum(now + (flow - values["outlet"] * np.sqrt(now)) / values["area_m2"], 0.0)
        return level

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return inflow and time."""
        return {"inflow": inputs["inflow_m3_s"], "time": inputs["t_s"]}


def filled(off: tuple[float, float]) -> Recording:
    """Return an hour of a tank whose parameters are off by so many standard deviations of their priors."""
    generator, time_s = np.random.default_rng(7), np.arange(3600.0)
    inflow = 0.010 + 0.004 * np.sign(np.sin(time_s / 170)) + 0.003 * np.sin(time_s / 61)
    values = {"area_m2": 0.5 + 0.02 * off[0], "outlet": 0.010 + 0.0004 * off[1]}
    level = Tank().predict({"inflow_m3_s": inflow[:, None]}, values)[:, 0]
    noise = np.convolve(generator.normal(0, 0.02, len(time_s) + 4), np.ones(5) / np.sqrt(5), "valid")
    return from_columns({"t_s": time_s, "level_m": level + noise, "inflow_m3_s": inflow})


@pytest.mark.parametrize("off", [(0.0, 0.0), (1.5, -1.5), (2.0, 2.0)])
def test_parameters_within_their_priors_are_no_missing_physics(off: tuple[float, float]) -> None:
    """Linearised once, a tank at 1.5 standard deviations is given a false name."""
    answer = compare(filled(off), Tank()).answer
    assert answer.verdict == "consistent"
    for parameter, away in zip(answer.parameters, off, strict=True):
        assert (parameter.value - parameter.prior) / parameter.prior_std == pytest.approx(away, abs=0.5)


class Pipe(Simulation):
    """The flow that a pump's head drives through a pipe: none where the head is below the static one."""

    channel, unit = "flow_m3_h", "m3/h"
    inputs = ("speed_1_s",)
    parameters: ClassVar = {"head_m": Prior(4.0, 3.0, "m")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the flow."""
        return np.sqrt(np.maximum(values["head_m"] * inputs["speed_1_s"] ** 2 - 1.0, 0.0) / 0.006)


def pipe_problem() -> Problem:
    """Return the problem of a pipe whose head is 2.5 m and stated as 4 m."""
    speed = 1.5 + 0.3 * np.sin(np.arange(600.0) / 20)
    measured = Pipe().predict({"speed_1_s": speed[:, None]}, {"head_m": 2.5})
    columns = {"t_s": np.arange(600.0), "speed_1_s": speed, "flow_m3_h": measured[:, 0]}
    return build_problem(from_columns(columns), Pipe())


def test_a_step_that_leads_too_far_is_halved() -> None:
    """Below 0 nothing flows and every tangent is 0; a quarter of the way there from 4 fits as the tangents promise."""
    problem = pipe_problem()
    assert not Step(problem, {"head_m": -1.0}).holds()
    assert Step(problem, {"head_m": -1.0}).damped() == {"head_m": 2.75}
    assert Step(problem, {"head_m": 2.5}).damped() == {"head_m": 2.5}


def test_a_step_is_judged_with_what_is_added_beside_it() -> None:
    """A curve that is all that is left by the tangents is no fit where the simulation does otherwise."""
    problem = pipe_problem()
    missing = (problem.measured - problem.changed(head_m=3.0))[problem.mask]
    assert Step(problem, {"head_m": 3.0}, missing).damped() == {"head_m": 3.0}
    far = Step(problem, {"head_m": -1.0})
    curve = far.measured - far.along
    assert not Step(problem, {"head_m": -1.0}, curve).holds()
    assert 1.0 < Step(problem, {"head_m": -1.0}, curve).damped()["head_m"] < 4.0


def test_values_that_fit_worse_than_the_stated_ones_are_told() -> None:
    """One linearisation from 9 m goes to where the simulation is further from the recording than at 2.5 m."""
    right = pipe_problem()
    near = replace(right, values={"head_m": 2.5}, prediction=right.changed(head_m=2.5))
    far = replace(right, values={"head_m": 9.0}, prediction=right.changed(head_m=9.0), made={})
    equations = free_parameter_equations(far)
    (note,) = worse_than_stated(equations, equations.fit(()), near)
    assert "instead of 0 m3/h as stated): do not use it" in note
    assert worse_than_stated(equations, equations.fit(()), far) == ()


def test_what_is_called_calibrated_has_been_run() -> None:
    """The simulation at the reported values has the error that the answer reports."""
    recording = filled((1.5, -1.5))
    answer = compare(recording, Tank()).answer
    values = {parameter.name: parameter.value for parameter in answer.parameters}
    level = Tank().predict({"inflow_m3_s": recording.channels["inflow_m3_s"]}, values)
    rmse = float(np.sqrt(np.mean((recording.channels["level_m"] - level) ** 2)))
    assert rmse == pytest.approx(answer.fit.held_out_rmse_after, rel=0.02)


def test_an_effect_that_moves_parameters_far_is_searched_for_once() -> None:
    """Curves over the covariates stand for it before the search, so that this begins where the parameters end."""
    recording, told = filled((1.5, -1.5)), list[str]()
    leak = 0.3 * recording.channels["inflow_m3_s"] / 0.01
    columns = {name: values[:, 0] for name, values in recording.channels.items()}
    columns = {**columns, "t_s": recording.time_s, "level_m": columns["level_m"] + leak[:, 0]}
    compare(from_columns(columns), Tank(), progress=told.append)
    assert told.count("searching") == 1


def test_a_step_is_bent_by_what_noise_lets_pass_not_by_what_is_left_out() -> None:
    """A drag that is left out hides that tangents do not hold; once it stands beside the prediction, it does not."""
    problem = pipe_problem()
    off = replace(problem, measured=problem.measured + 100.0)
    beside = np.full(int(problem.mask.sum()), 100.0)
    assert Step(problem, {"head_m": 2.5}).is_bent()
    assert not Step(off, {"head_m": 2.5}).is_bent()
    assert Step(off, {"head_m": 2.5}, beside).is_bent()


class Geared(Simulation):
    """The current of a motor by its torque constant, and by a friction of its own."""

    channel, unit = "current_A", "A"
    inputs = ("torque_Nm",)
    parameters: ClassVar = {"constant_Nm_A": Prior(0.4, 0.008, "N·m/A"), "idle_A": Prior(0.5, 0.01, "A")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current."""
        return inputs["torque_Nm"] / values["constant_Nm_A"] + values["idle_A"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the torque."""
        return {"load": inputs["torque_Nm"]}


@pytest.mark.parametrize(("constant", "value"), [(0.55, 0.55), (0.8, None)])
def test_a_value_that_the_simulation_does_not_go_along_with_is_none(constant: float, value: float | None) -> None:
    """A torque constant that is a third larger than stated is told, and not a fit's promise of one twice as large."""
    answer = compare(geared(constant, 0.5), Geared()).answer
    moved = [each.value for each in answer.parameters if each.prior_stds_away > 3]
    assert moved == ([] if value is None else [pytest.approx(value, rel=0.01)])
    assert answer.verdict == ("unexplained" if value is None else "missing-physics")


def geared(constant: float, idle: float) -> Recording:
    """Return the current of a motor with this torque constant [N·m/A] and idle current [A]."""
    random = np.random.default_rng(5)
    torque = np.repeat(random.uniform(1, 9, 200), 10)
    noise = random.normal(0, 0.05, len(torque))
    return from_columns(
        {"t_s": np.arange(2000) * 0.1, "torque_Nm": torque, "current_A": torque / constant + idle + noise}
    )
