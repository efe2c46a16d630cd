"""A corrected simulation against later recordings: unchanged, more, gone; and parameters far from their priors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.answer import Change
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.changes import (
    SECANT_CHANGE,
    ChangedSize,
    change_in_words,
    corrected_problem,
    direction_of,
    stated_in,
    with_changes,
)
from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.regression.equations import smooth_equations, with_library
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.groups.candidate_groups import implausibility
from regolithd.calibration.mismatch.regression.residuals import residual_of
from regolithd.calibration.mismatch.selection.cross_validation import transfer_margin
from regolithd.calibration.mismatch.selection.plausibility.law_misfit import explained, without_terms
from regolithd.calibration.mismatch.selection.slow_noise import score_beside_slow_noise

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

    Array = NDArray[np.float64]

STEP_S = 0.05
COULOMB = Contribution("coulomb-friction", {}, (0.5,), (1,), relative_std=0.04)
VISCOUS = Contribution("viscous-friction", {"power": 0.85}, (0.5,), (1,), relative_std=0.04, shape_std={"power": 0.1})


class Axis(Simulation):
    """Force of inertia and viscous drag."""

    channel, unit, wheel_column = "force_N", "N", "axis"
    inputs = ("acceleration_m_s2", "speed_m_s")
    parameters: ClassVar = {"mass_kg": Prior(2.0, 0.04, "kg"), "drag_N_s_m": Prior(1.0, 0.02, "N·s/m")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return mass times acceleration and drag times speed."""
        return values["mass_kg"] * inputs["acceleration_m_s2"] + values["drag_N_s_m"] * inputs["speed_m_s"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed and time."""
        return {"wheel_speed": inputs["speed_m_s"], "time": inputs["t_s"]}


def moving(seed: int, coulomb_N: float, mass_kg: float = 2.0) -> Recording:
    """Return two minutes of an axis that moves to and fro under white noise."""
    generator = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(2400)
    speed = np.sin(0.9 * time_s + generator.uniform(0, 6)) + 0.7 * np.sin(2.3 * time_s)
    acceleration = np.gradient(speed, STEP_S)
    force = mass_kg * acceleration + speed + coulomb_N * np.sign(speed) + generator.normal(0, 0.2, len(time_s))
    columns = {"t_s": time_s, "force_N": force, "acceleration_m_s2": acceleration, "speed_m_s": speed}
    return from_columns(columns)


def test_a_recording_that_agrees_with_the_correction_is_consistent() -> None:
    """Within the corrected effect's own standard deviation nothing has changed."""
    answer = compare(moving(1, 0.5), Axis(), effects=[COULOMB]).answer
    assert answer.verdict == "consistent"
    assert not answer.changes


@pytest.mark.parametrize("now_N", [0.8, 0.25])
def test_more_or_less_of_a_corrected_effect_is_told_with_its_size(now_N: float) -> None:
    """The change has the effect's name and holds the true size in its interval."""
    answer = compare(moving(2, now_N), Axis(), effects=[COULOMB]).answer
    assert answer.verdict == "missing-physics"
    (change,) = answer.changes
    assert (change.name, change.parameter, change.corrected) == ("coulomb-friction", "coulomb_current", 0.5)
    assert change.low < now_N < change.high
    assert not answer.effects


def test_a_corrected_effect_that_is_gone_is_called_gone() -> None:
    """Its interval holds zero, and its sentence says so; no note repeats it."""
    answer = compare(moving(3, 0.0), Axis(), effects=[COULOMB]).answer
    (change,) = answer.changes
    assert change.low <= 0 < change.high
    assert change.statement.startswith("coulomb-friction is gone: coulomb_current from 0.5 to ")
    assert (change.unit, change.channel, change.wheels) == ("N", "force_N", (1,))
    assert not any("coulomb-friction is gone" in note for note in answer.notes)


@pytest.mark.parametrize(("fitted", "secant"), [(0.4, 0.4), (-0.7, -0.7), (-1.6, -1.0)])
def test_a_law_that_is_not_linear_is_linearised_over_its_change_down_to_nothing(fitted: float, secant: float) -> None:
    """Less than nothing of an effect is not asked of its law."""
    delay = Contribution("sensor-delay", {"delay_s": 0.5}, (1.0,), (1,))
    (stated,) = stated_in(library(), [delay], [])
    changed = ChangedSize(stated, 0, stated.candidate)
    problem: Any = None  # of no account
    assert changed.self_consistent_shape(problem, {SECANT_CHANGE: -0.3}, [fitted]) == {SECANT_CHANGE: secant}


def late(by_s: float) -> Recording:
    """Return an axis whose force is read so much later than it acts."""
    recording = moving(6, 0.0)
    time_s, force = recording.time_s, recording.channels["force_N"][:, 0]
    return recording.with_channels(force_N=np.interp(time_s - by_s, time_s, force)[:, None])


@pytest.mark.parametrize("now_s", [0.0, 0.3, 1.0])
def test_a_change_of_a_law_that_is_not_linear_in_its_size_has_the_right_size(now_s: float) -> None:
    """Half a second more of delay is another course of the channel, and not twice the same one."""
    delay = Contribution("sensor-delay", {"late": "force_N", "secant_s": 0.5}, (0.5,), (1,), relative_std=0.04)
    answer = compare(late(now_s), Axis(), effects=[delay]).answer
    (change,) = answer.changes
    assert (change.parameter, change.now) == ("delay_s", pytest.approx(now_s, abs=0.03))
    assert change.low <= now_s < change.high
    assert not answer.effects
    assert compare(late(0.5), Axis(), effects=[delay]).answer.verdict == "consistent"


def test_a_change_is_told_over_the_transition_that_the_recording_shows() -> None:
    """A friction that was corrected as a step reverses gradually: more of it is a change, and no further name."""
    recording = moving(7, 0.0)
    speed, force = recording.channels["speed_m_s"], recording.channels["force_N"]
    answer = compare(recording.with_channels(force_N=force + np.tanh(speed / 0.1)), Axis(), effects=[COULOMB]).answer
    (change,) = answer.changes
    assert change.low < 1.0 < change.high
    assert (answer.verdict, answer.effects) == ("missing-physics", ())


def test_a_correction_of_a_correction_is_one_effect() -> None:
    """Entries of one name, shape and wheels are summed, their spreads in quadrature."""
    known = [candidate for candidate in library() if candidate.name == "coulomb-friction"]
    more = Contribution("coulomb-friction", {}, (0.3,), (1,), relative_std=0.1)
    (stated,) = stated_in(known, [COULOMB, more], [])
    assert stated.contribution.coefficients == (0.8,)
    assert stated.contribution.relative_std == pytest.approx(np.hypot(0.02, 0.03) / 0.8)


def test_an_effect_that_no_candidate_has_is_refused_by_name() -> None:
    """The message lists what is known."""
    with pytest.raises(SimulationError, match="has stiction, which is not looked for with this simulation"):
        stated_in([], [Contribution("stiction", {}, (1.0,), (1,))], [])


def test_a_parameter_that_had_to_leave_its_prior_is_a_finding() -> None:
    """A mass that is six standard deviations off is told, with its value, and is not called consistent."""
    answer = compare(moving(4, 0.0, mass_kg=2.24), Axis()).answer
    assert answer.verdict == "missing-physics"
    (mass,) = (each for each in answer.parameters if each.name == "mass_kg")
    assert mass.low < 2.24 < mass.high
    assert any("mass_kg had to leave its prior" in note for note in answer.notes)


def test_the_answer_tells_where_each_parameter_is() -> None:
    """Prior, value and interval, for those that the priors hold too."""
    answer = compare(moving(5, 0.0), Axis()).answer
    assert [each.name for each in answer.parameters] == ["mass_kg", "drag_N_s_m"]
    assert all(each.low < each.value < each.high for each in answer.parameters)
    written = answer.to_json()
    assert written["version"] == 2
    assert written["parameters"][0]["prior"] == 2.0
    assert written["changes"] == []


def test_a_corrected_effect_whose_covariate_was_never_measured_is_one_message() -> None:
    """The message names the effect and what it needs."""
    whole = moving(1, 0.5)
    blank = whole.with_channels(speed_m_s=np.full(whole.shape, np.nan))

    class WithoutDrag(Axis):
        inputs = ("acceleration_m_s2",)

        def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
            return values["mass_kg"] * inputs["acceleration_m_s2"]

    with pytest.raises(
        SimulationError, match="coulomb-friction depends on direction, which this recording does not have"
    ):
        compare(blank, WithoutDrag(), effects=[COULOMB])


@pytest.mark.parametrize(
    ("now", "low", "high", "direction"),
    [
        (0.05, -0.1, 0.2, "gone"),
        (-0.05, -0.2, 0.1, "gone"),
        (0.05, 0.0, 0.1, "gone"),
        (-0.05, -0.1, 0.0, "gone"),
        (0.05, 0.1, 0.0, "gone"),
        (0.05, 0.02, 0.08, "smaller"),
        (0.3, -0.1, 0.7, "gone"),
        (0.8, 0.7, 0.9, "smaller"),
        (-0.8, -0.9, -0.7, "smaller"),
        (1.2, 1.1, 1.3, "larger"),
        (-1.2, -1.3, -1.1, "larger"),
    ],
)
def test_an_effect_is_gone_where_it_is_smaller_and_may_be_zero(
    now: float, low: float, high: float, direction: str
) -> None:
    """With 0 in its interval; else its size decides, whatever its sign."""
    assert direction_of(Change("drag", "drag", 1.0, now, low, high)) == direction
    assert direction_of(Change("drag", "drag", -2.0, -2 * now, -2 * low, -2 * high)) == direction


def test_a_change_is_told_with_both_sizes_and_the_interval() -> None:
    """In one sentence; an effect of size 0 can only have become larger."""
    assert change_in_words(Change("drag", "drag_current", 0.62, 0.9137, 0.88, 0.94, "A"), ", on both axes", "drag") == (
        "drag is larger than the corrected simulation has it, on both axes: drag_current from 0.62 to 0.914 A "
        "(90 % sure: 0.880 to 0.940)."
    )
    gone = change_in_words(Change("drag", "d", 1.0, 0.01, -0.02, 0.04), "", "drag")
    assert gone.startswith("drag is gone: d from 1 to 0.010 (90 % sure")
    assert direction_of(Change("drag", "d", 0.0, 0.5, 0.4, 0.6)) == "larger"


def test_a_power_that_is_not_known_exactly_adds_what_is_no_change_of_size() -> None:
    """One standard deviation of it, to first order, beside the effect's own course."""
    problem = build_problem(moving(1, 0.0), Axis())
    (stated,) = stated_in(library(), [VISCOUS], [])
    (deviation,) = stated.deviations(problem)
    column = stated.column(problem)
    assert abs(np.vdot(deviation, column)) < 1e-9 * float(np.vdot(column, column))
    speed = problem.covariates["wheel_speed"]
    steeper = 0.5 * np.sign(speed) * (np.abs(speed) ** 0.95 - np.abs(speed) ** 0.85)
    steeper -= np.vdot(steeper, column) / np.vdot(column, column) * column
    assert float(np.linalg.norm(deviation - steeper)) < 0.1 * float(np.linalg.norm(steeper))


@pytest.mark.parametrize("times", [1.0, 3.0])
def test_a_power_found_a_little_wrong_is_no_further_effect(times: float) -> None:
    """The true power is 1; the corrected file has 0.85 ± 0.1, and the friction stays or has grown."""
    recording = moving(5, 0.0)
    more = replace_force(recording, 0.5 * times * recording.channels["speed_m_s"])
    answer = compare(more, Axis(), effects=[VISCOUS]).answer
    assert answer.effects == ()
    assert answer.unexplained == ()
    assert [change.name for change in answer.changes] == (["viscous-friction"] if times > 1 else [])
    for change in answer.changes:
        assert change.now / change.corrected == pytest.approx(times, rel=0.15)


def replace_force(recording: Recording, more_N: Array) -> Recording:
    """Return a recording with more force, shape (time, 1)."""
    columns = {name: values[:, 0] for name, values in recording.channels.items()}
    return from_columns({**columns, "t_s": recording.time_s, "force_N": columns["force_N"] + more_N[:, 0]})


def test_beside_a_corrected_effect_what_is_new_is_charged() -> None:
    """That the known friction changed is more likely than that another loss began."""
    recording = moving(1, 0.9)
    stated = stated_in(library(), [COULOMB], [])
    problem = corrected_problem(build_problem(recording, Axis()), stated)
    known = next(each for each in with_changes(problem, library(), stated) if each.name == "coulomb-friction")
    other = next(each for each in library() if each.name == "quadratic-drag")
    charged = problem.thresholds.new_effect_penalty
    assert implausibility(problem, other, {}) == charged > 0
    assert implausibility(problem, known, {}) == 0
    assert implausibility(build_problem(recording, Axis()), other, {}) == 0


def residual_power(equations: NormalEquations, fit: Fit) -> float:
    """Return the sum of squares that a fit leaves."""
    return float(np.sum(residual_of(equations, fit) ** 2))


def test_a_law_s_misfit_is_of_the_whole_effect() -> None:
    """A corrected effect that is half as large again explains (1 + 1/2)² of its energy, not a quarter of it."""
    recording = moving(1, 0.75)
    stated = stated_in(library(), [COULOMB], [])
    problem = corrected_problem(build_problem(recording, Axis()), stated)
    equations, _ = with_library(smooth_equations(problem), with_changes(problem, (), stated))
    (group,) = [each for each in equations.design.groups if each.named]
    fit = equations.fit([Term(group, (0,))])
    size = fit.coefficients[-1] / equations.design.scale[group.columns[0]]
    assert size == pytest.approx(0.5, abs=0.1)
    place = equations.nuisance.names.index("coulomb-friction as corrected")
    held = equations.with_nuisance(equations.nuisance.with_precision(place, 1e12))
    gained = held.fit([Term(group, (0,))]).delta_chi2
    beyond = explained(equations, fit) - fit.delta_chi2
    assert beyond == pytest.approx(gained * ((1 + size) ** 2 - size**2) / size**2, rel=0.1)


def grown(relative_std: float) -> tuple[NormalEquations, list[Term]]:
    """Return equations of friction that is half as large again as it was corrected, and the change's term."""
    stated = stated_in(library(), [replace(COULOMB, relative_std=relative_std)], [])
    problem = corrected_problem(build_problem(moving(1, 1.5), Axis()), stated)
    equations, _ = with_library(smooth_equations(problem), with_changes(problem, (), stated))
    (group,) = [each for each in equations.design.groups if each.named]
    return equations, [Term(group, (0,))]


def test_a_change_gains_beyond_the_corrected_effect_as_it_was() -> None:
    """A size that is known badly could take the change up itself, on other readings too: nothing would be gained."""
    equations, terms = grown(5.0)
    fit = equations.fit(terms)
    assert residual_power(equations, equations.fit(())) < 1.01 * residual_power(equations, fit)
    assert residual_power(equations, without_terms(equations, [terms[0]], ())) > 2 * residual_power(equations, fit)
    assert transfer_margin(equations, terms, 0, 8.0) > 0


def test_a_change_has_evidence_beside_slow_noise_as_the_corrected_size_is_as_it_was() -> None:
    """The size that was corrected stands for the change where there is none, and is then far from what was found."""
    equations, terms = grown(0.3)
    by_weights = equations.score(equations.fit(terms)) - equations.score(equations.fit(()))
    assert by_weights > 10
    assert score_beside_slow_noise(equations, (), terms) == pytest.approx(by_weights, rel=0.1)


@pytest.mark.parametrize("one_way", [True, False])
def test_a_change_has_the_experiment_of_its_effect_also_on_a_machine_that_runs_one_way(one_way: bool) -> None:
    """No reversal is asked for where the machine cannot reverse."""

    class Pump(Axis):
        pass

    Pump.one_way = one_way
    problem = build_problem(moving(1, 0.0), Pump())
    stated = stated_in(library(), [VISCOUS], [])
    *_, change = with_changes(corrected_problem(problem, stated), library(), stated)
    (viscous,) = (each for each in library() if each.name == "viscous-friction")
    assert change.instruction(problem.simulation) == viscous.instruction(problem.simulation)
    assert ("both ways" in change.instruction(problem.simulation)) == (not one_way)


def test_a_change_on_one_of_six_axes_is_as_large_as_it_is_there() -> None:
    """Of the mean over all six it would be less than the smallest effect."""
    parts = [moving(seed, 0.62 if seed == 2 else 0.0) for seed in range(6)]
    columns = {
        name: np.concatenate([part.channels[name] for part in parts], axis=1).ravel()
        for name in ("force_N", "acceleration_m_s2", "speed_m_s")
    }
    axes = {"t_s": np.repeat(parts[0].time_s, 6), "axis": np.tile(np.arange(6), len(parts[0].time_s))}
    recording = from_columns({**axes, **columns}, unit="axis")
    corrected = Contribution("coulomb-friction", {}, (0.5,), (2,), relative_std=0.04)
    answer = compare(recording, Axis(), effects=[corrected]).answer
    (change,) = answer.changes
    assert change.low < 0.62 < change.high
    assert change.wheels == (2,)
    assert not answer.effects
    assert not answer.unexplained
