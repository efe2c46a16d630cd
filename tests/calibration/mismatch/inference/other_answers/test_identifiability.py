"""Identifiability and sensitivity: what a recording cannot tell apart, and what it would have shown."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest
from linear_machine import AXES, CANDIDATES, INSTANTS, Constant, Drag, Power, equations_of, problem_of, table, term_of

from regolithd.calibration.mismatch.experiments.choice import Experimenter, experimenter_of
from regolithd.calibration.mismatch.inference.other_answers.alternatives import Alternative
from regolithd.calibration.mismatch.inference.other_answers.collinearity import (
    Beside,
    collinear_sets,
    energy_apart,
    imitates,
    parameters_like,
    representatives,
)
from regolithd.calibration.mismatch.inference.other_answers.experiment import (
    rounded_up,
    seconds_needed,
    with_experiment,
)
from regolithd.calibration.mismatch.inference.other_answers.identifiability import (
    indistinguishable,
    rivals,
    wrong_choice_rate,
)
from regolithd.calibration.mismatch.inference.uncertainty.sensitivity import sensitivities, smallest_detectable
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.groups.candidate_groups import with_candidate
from regolithd.calibration.mismatch.selection.best_subsets import acceptable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch import Problem, Shape
    from regolithd.calibration.mismatch.regression.group import Fit
    from regolithd.calibration.mismatch.regression.normal_equations import NormalEquations

THRESHOLD = 8.0


def one_speed(drag: float = 0.3) -> dict[str, np.ndarray]:
    """Return a recording at one size of speed, both ways: it tells a drag from a power of the speed, and no powers."""
    columns = table()
    sign = np.sign(columns["speed_rad_s"])
    speed = 0.8 * np.where(sign == 0, 1.0, sign)
    noise = columns["reading_V"] - 2.0
    return {**columns, "speed_rad_s": speed, "reading_V": 2.0 + drag * np.sign(speed) + noise}


class LikeDrag(Drag):
    """Another law that is the drag but for a hundredth."""

    name = "like-drag"

    def columns(self, problem: object, shape: object) -> np.ndarray:
        """Return nearly sign(ω)."""
        return super().columns(problem, shape) * (1 + 0.01 * np.sin(problem.time_s))  # type: ignore[arg-type, attr-defined]


def test_a_pair_that_is_nearly_one_is_a_set() -> None:
    """Each could stand for each; what can be told apart is in none."""
    equations = equations_of(problem_of(table()), (Drag(), LikeDrag(), Power()))
    sets = collinear_sets(equations, equations.fit(()), experimenter_of(equations, THRESHOLD))
    assert [one.effects for one in sets if "drag" in one.effects] == [("drag", "like-drag")]
    assert "drive both ways" in sets[0].experiment.lower()
    terms = representatives(equations)
    beside = Beside(equations, equations.fit(()), [term for shapes in terms.values() for term in shapes])
    assert imitates(beside, terms["drag"], terms["like-drag"])
    assert not imitates(beside, terms["drag"], terms["power"])


def test_what_a_free_parameter_hides_is_in_a_set_with_it() -> None:
    """An offset is the level's error."""
    equations = equations_of(problem_of(table()), (Constant(), Drag()))
    offset, drag = term_of(equations, "offset"), term_of(equations, "drag")
    assert parameters_like(equations, (), [offset]) == ["level-error"]
    assert parameters_like(equations, (), [drag]) == []
    assert parameters_like(equations, (), [offset, drag]) == []
    assert equations.nuisance.precision[0] == pytest.approx(4.0, rel=1e-6)


class Waning(Drag):
    """A drag that falls with time, by any rate."""

    name = "waning"
    free: ClassVar = {"rate": (0.0, 6.0)}
    shape_keys: ClassVar = {"rate": "1/length"}
    rates = (1.0, 2.0, 4.0)

    def shapes(self, problem: Problem) -> Sequence[Shape]:  # noqa: ARG002
        """Return three rates."""
        return [{"rate": rate} for rate in self.rates]

    def bounds(self, problem: Problem, shape: Shape) -> dict[str, tuple[float, float]]:  # noqa: ARG002
        """Return all rates."""
        return dict(self.free)

    def columns(self, problem: Problem, shape: Shape) -> np.ndarray:
        """Return sign(ω) exp(−rate t / length)."""
        part = (problem.time_s - problem.time_s.min()) / problem.length_s
        return super().columns(problem, shape) * np.exp(-float(shape["rate"]) * part)


def waning(law: float, steady: float, rate: float, fitted: float) -> tuple[NormalEquations, Fit]:
    """Return equations of a waning drag with a steady one beside it, and a fit of the waning one alone."""
    columns = table()
    part, sign = (columns["t_s"] - columns["t_s"][0]) / np.ptp(columns["t_s"]), np.sign(columns["speed_rad_s"])
    columns = {**columns, "reading_V": columns["reading_V"] + sign * (law * np.exp(-rate * part) + steady)}
    equations = equations_of(problem_of(columns), (Drag(), Waning()))
    design, (group,) = with_candidate(equations.design, Waning(), [{"rate": fitted}])
    equations = equations.over(design)
    return equations, equations.fit([Term(group, tuple(range(AXES)))])


def test_a_law_with_a_free_shape_may_stand_for_itself_and_for_another() -> None:
    """At a rate between that of the waning drag and 0 nothing is left for the steady one; alone it is what it is."""
    equations, named = waning(0.3, 0.3, 1.0, 0.38)
    _, (found,) = rivals(equations, named, experimenter_of(equations, THRESHOLD))
    assert (found.effects, found.beside, found.alone) == (("waning", "drag"), ("drag",), ("waning",))
    equations, named = waning(0.6, 0.0, 4.0, 4.0)
    assert rivals(equations, named, experimenter_of(equations, THRESHOLD))[1] == ()


def test_energy_apart_is_the_gain_at_the_size_worth_telling_apart() -> None:
    """Tolerance times size squared times the readings' weights."""
    equations = equations_of(problem_of(table()))
    drag = term_of(equations, "drag")
    size = 0.15 * equations.problem.mean_size
    expected = equations.tolerance((), drag) * size**2 * equations.weights[0] * INSTANTS * AXES
    assert energy_apart(equations, (), drag) == pytest.approx(expected)


def test_one_complement_serves_all_pairs() -> None:
    """What is left of a term beside a fit and another term is what equations with all of them leave."""
    equations = equations_of(problem_of(table(drag=0.3)), (Drag(), LikeDrag(), Power()))
    drag, like, power = (term_of(equations, name) for name in ("drag", "like-drag", "power"))
    beside = Beside(equations, equations.fit([power]), [drag, like, power])
    assert beside.apart(drag) == pytest.approx(energy_apart(equations, [power], drag), rel=1e-6)
    assert beside.apart(drag, like) == pytest.approx(energy_apart(equations, [power, like], drag), rel=1e-3)
    assert beside.apart(drag, power) == pytest.approx(beside.apart(drag), rel=1e-6)


def test_a_named_effect_has_those_rivals_that_fit_as_well() -> None:
    """A twin is one, a power of the speed is none; the rivals' shapes are optimised in new equations."""
    equations = equations_of(problem_of(table(drag=0.3)), (Drag(), LikeDrag(), Power()))
    named = equations.fit([term_of(equations, "drag")])
    extended, (found,) = rivals(equations, named, experimenter_of(equations, THRESHOLD))
    assert found.effects[:2] == ("drag", "like-drag")
    assert "power" not in found.effects
    assert extended.design.size >= equations.design.size
    _, sets = indistinguishable(equations, named, named, THRESHOLD)
    assert sum("drag" in one.effects for one in sets) == 1


def test_a_clear_effect_has_no_rivals() -> None:
    """Speeds of many sizes tell the drag from all others."""
    equations = equations_of(problem_of(table(drag=0.3)), (Drag(), Power()))
    assert (
        rivals(equations, equations.fit([term_of(equations, "drag")]), experimenter_of(equations, THRESHOLD))[1] == ()
    )


class Cooling(Drag):
    """A drag that falls as the recording warms from 0 to 1, by a share or not at all."""

    name = "cooling"
    falls = 0.02

    def shapes(self, problem: Problem) -> Sequence[Shape]:  # noqa: ARG002
        """Return the law."""
        return [{"falls": self.falls}]

    def without_covariate(self, shape: Shape) -> Shape:
        """Return the same drag at any temperature."""
        return {**shape, "falls": 0.0}

    def columns(self, problem: Problem, shape: Shape) -> np.ndarray:
        """Return sign(ω), less a share that grows with the warmth."""
        warmth = problem.time_s / problem.length_s
        return super().columns(problem, shape) * (1 - float(shape["falls"]) * warmth)


class QuicklyCooling(Cooling):
    """A drag that nearly vanishes over the same warmth."""

    name, falls = "quickly-cooling", 0.9


def test_a_law_whose_covariate_hardly_varied_is_a_rival_though_it_gains_nothing_by_it() -> None:
    """It cannot be named, and nothing speaks against it; where the covariate would have shown, the law is refuted."""
    equations = equations_of(problem_of(table(drag=0.3)), (Drag(), Cooling(), QuicklyCooling()))
    assert not acceptable(equations, equations.fit([term_of(equations, "cooling")]))
    _, (found,) = rivals(equations, equations.fit([term_of(equations, "drag")]), experimenter_of(equations, THRESHOLD))
    assert found.effects == ("drag", "cooling")


class HalfTheTime(Drag):
    """A drag that ends after half of the recording."""

    name = "half-the-time"

    def columns(self, problem: object, shape: object) -> np.ndarray:
        """Return sign(ω) before the middle."""
        before = problem.time_s < 0.5 * problem.length_s  # type: ignore[attr-defined]
        return super().columns(problem, shape) * before  # type: ignore[arg-type]


def test_what_explains_a_part_of_an_effect_is_no_rival_of_it() -> None:
    """It has its sign and is large enough, but the recording speaks for the whole effect."""
    equations = equations_of(problem_of(table(drag=0.3)), (Drag(), HalfTheTime()))
    part = equations.fit([term_of(equations, "half-the-time")])
    assert acceptable(equations, part)
    assert (
        rivals(equations, equations.fit([term_of(equations, "drag")]), experimenter_of(equations, THRESHOLD))[1] == ()
    )


@pytest.mark.parametrize(("lead", "apart", "rate"), [(0.0, 10.8241, 0.05), (0.0, 1e-6, 0.5), (8.0, 4.0, 0.00135)])
def test_wrong_choices_are_as_frequent_as_a_normal_lead_says(lead: float, apart: float, rate: float) -> None:
    """The lead is normal about μ with variance 4 μ."""
    assert wrong_choice_rate(lead, apart) == pytest.approx(rate, rel=0.02)


def test_the_smallest_detectable_drag_is_what_its_noise_allows() -> None:
    """Its Δχ² passes the threshold nine times in ten."""
    equations = equations_of(problem_of(table(noise=0.2)))
    drag = term_of(equations, "drag")
    found = smallest_detectable(equations, (), drag, THRESHOLD)
    needed = (np.sqrt(THRESHOLD + 2) + 1.2816) ** 2
    assert found == pytest.approx(
        max(np.sqrt(needed / (equations.weights[0] * INSTANTS * AXES)), 0.02 * equations.problem.mean_size), rel=0.1
    )
    higher = smallest_detectable(equations, (), drag, 1000.0)
    assert higher > 3 * found
    one_axis = smallest_detectable(equations, (), term_of(equations, "drag", (0,)), 1000.0)
    assert one_axis > 1.3 * higher


def test_what_cannot_show_has_no_smallest_size() -> None:
    """A candidate without columns, another's combination, and one that shows at many times the mean alone."""
    equations = equations_of(problem_of(table()), (Drag(),))
    found = {one.name: one for one in sensitivities(equations, equations.fit(()), CANDIDATES, THRESHOLD)}
    assert list(found) == sorted(found)
    assert found["power"].smallest_detectable == float("inf")
    assert found["drag"].smallest_detectable < 1
    assert found["drag"].unit == "V"
    twice = term_of(equations, "drag")
    assert smallest_detectable(equations, [twice], twice, THRESHOLD) == float("inf")
    named = equations.fit([twice])
    (again,) = sensitivities(equations, named, (Drag(),), THRESHOLD)
    assert again.smallest_detectable == pytest.approx(found["drag"].smallest_detectable)
    assert smallest_detectable(equations, (), twice, 1e9) == float("inf")


def test_at_one_size_of_speed_powers_are_one_effect() -> None:
    """Nothing tells a power from an offset there."""
    equations = equations_of(problem_of(one_speed()), (Constant(), Drag(), Power()))
    assert equations.tolerance([term_of(equations, "offset")], term_of(equations, "power")) < 1e-3
    assert equations.tolerance((), term_of(equations, "drag")) > 0.5


class Patient(Drag):
    """A drag whose experiment has a part without load, and names a covariate in braces."""

    name = "patient"
    experiment = "wait for {time}"
    vary: ClassVar = ("time", "wheel_speed")
    run_unloaded: ClassVar = True


def unpredicted(equations: NormalEquations) -> Experimenter:
    """Return an experimenter that cannot predict a drive."""
    return replace(experimenter_of(equations, THRESHOLD), drives=None, unpredictable="it has a state")


def test_an_experiment_names_each_drive_once_and_its_length() -> None:
    """Capitalised, joined, in the machine's words; the same as data."""
    equations = equations_of(problem_of(table()), (Drag(), Power(), Patient()))
    members = [term_of(equations, name) for name in ("drag", "patient", "power")]
    found = with_experiment(("drag", "patient", "power"), unpredicted(equations), (), members)
    assert found.experiment.startswith("Drive both ways; then wait for time; then drive fast and slowly; ")
    assert found.vary == ("direction", "time", "wheel_speed")
    assert not found.lift, "the machine does not say how it runs without load"
    alone = with_experiment(("drag",), unpredicted(equations), (), members[:1])
    assert alone.experiment == (
        f"Drive both ways; {rounded_up(alone.duration_s)[1]} in all. "
        "How well that tells them apart is not predicted: it has a state."
    )


def test_a_predicted_experiment_says_ranges_margin_and_the_closest_pair() -> None:
    """What follows from no drive is told by its own experiment behind it."""
    equations = equations_of(problem_of(one_speed()), (Constant(), Power(), Patient()))
    members = [term_of(equations, name) for name in ("offset", "patient", "power")]
    experimenter = experimenter_of(equations, THRESHOLD)
    found = with_experiment(("offset", "power"), experimenter, (), members[::2])
    assert "(speed 0.4 to 1.2 rad/s)" in found.experiment
    assert "Expected Δχ² between offset and power: " in found.experiment
    assert "tells them apart nine times in ten)" in found.experiment
    assert "wheel_speed" in found.vary
    faulty = replace(members[1], group=replace(members[1].group, shape={"onset_s": 1.0}))
    both = with_experiment(("offset", "patient", "power"), experimenter, (), [members[0], faulty, members[2]])
    assert "; then wait for time; " in both.experiment
    assert both.vary == (*found.vary, "time")


def test_other_likely_answers_are_told_apart_as_well() -> None:
    """One that is far behind is not, nor one that the set has."""
    equations = equations_of(problem_of(one_speed()), (Constant(), Drag(), Power()))
    offset, drag, power = (term_of(equations, name) for name in ("offset", "drag", "power"))
    experimenter = experimenter_of(equations, THRESHOLD)
    near, far = Alternative(("power",), 1.0, (power,)), Alternative(("power",), 30.0, (power,))
    first = Alternative(("drag",), 0.0, (drag,))
    alone = with_experiment(("offset", "drag"), experimenter, (), [offset, drag], (first, far))
    told = with_experiment(("offset", "drag"), experimenter, (), [offset, drag], (first, near))
    assert "power" not in alone.experiment
    assert "power" in told.experiment
    assert told.effects == ("offset", "drag")


def test_more_noise_needs_a_longer_experiment_within_what_the_recording_allows() -> None:
    """In proportion to the variance; from a third of the recording's length to four times it."""
    equations = equations_of(problem_of(table()))
    length_s = equations.problem.length_s
    assert seconds_needed(equations.weighted(equations.weights * 1e6), THRESHOLD) == pytest.approx(length_s / 3)
    assert seconds_needed(equations.weighted(equations.weights / 1e6), THRESHOLD) == pytest.approx(4 * length_s)
    limits = replace(equations.thresholds, shortest_experiment=0.0, longest_experiment=1e9)
    free = replace(equations.problem, thresholds=limits)
    open_ended = replace(equations, design=replace(equations.design, problem=free))
    found = seconds_needed(open_ended, THRESHOLD)
    assert seconds_needed(open_ended.weighted(open_ended.weights / 4), THRESHOLD) == pytest.approx(4 * found)


@pytest.mark.parametrize(
    ("seconds", "rounded", "words"),
    [(3.0, 5.0, "5 s"), (31.0, 35.0, "35 s"), (310.0, 600.0, "10 minutes"), (18100.0, 36000.0, "10 hours")],
)
def test_a_duration_is_told_in_its_own_unit(seconds: float, rounded: float, words: str) -> None:
    """Rounded up to five of them."""
    assert rounded_up(seconds) == (rounded, words)


def instruction(equations: NormalEquations, name: str) -> str:
    """Return the text of the experiment for one effect alone."""
    return with_experiment((name,), unpredicted(equations), (), [term_of(equations, name)]).experiment


def test_where_free_parameters_hide_a_member_the_load_is_taken_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """If the machine says how to run without its load."""
    equations = equations_of(problem_of(table()), (Constant(), Drag()))
    monkeypatch.setattr(type(equations.problem.simulation), "unloaded_experiment", "lift it", raising=False)
    assert "lift it" in instruction(equations, "offset")
    assert "lift it" not in instruction(equations, "drag")
    strict = replace(equations.problem, thresholds=replace(equations.thresholds, experiment_tolerance=1e-9))
    patient = replace(equations, design=replace(equations.design, problem=strict))
    assert "lift it" not in instruction(patient, "offset")


def test_what_cannot_be_told_apart_does_not_depend_on_what_was_searched_for() -> None:
    """A shape that a search came by between the points of the grid represents no candidate."""
    equations = equations_of(problem_of(table(factor=0.3)))
    design, _ = with_candidate(equations.design, Power(), [{"power": 1.23}], [1.0])
    searched = equations.over(design)
    assert len(searched.design.groups) == len(equations.design.groups) + 1
    shapes = {name: [term.group.shape for term in terms] for name, terms in representatives(searched).items()}
    assert shapes == {name: [term.group.shape for term in terms] for name, terms in representatives(equations).items()}
    assert shapes["power"] == [{"power": 1.0}, {"power": 2.0}]
