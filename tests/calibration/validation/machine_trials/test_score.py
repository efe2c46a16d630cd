"""The scorer on answers made by hand: what is right, and every way to be wrong."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import pytest

from regolithd.calibration.validation.machine_trials.batch import Outcome
from regolithd.calibration.validation.machine_trials.score import Verdict, figures, judge

Answer = dict[str, Any]


def concealed(name: str | None = "coulomb-friction", **other: object) -> Answer:
    """Return one effect as the truth has it: 15 % on both axes of a servo joint."""
    return {
        "name": name,
        "kind": name or "hard-stop",
        "channel": "motor_current_A",
        "axes": ["elbow", "wrist"],
        "covariate": "direction" if name else "position",
        "onset_s": None,
        "strength": 0.15,
        "parameters": {"coulomb_current": 0.2, "relative_size": 0.15},
        **other,
    }


def truth(kind: str, *effects: Answer, **other: object) -> Answer:
    """Return what is sealed of a servo joint's case."""
    return {
        "machine": "servo-joint",
        "kind": kind,
        "index": 0,
        "concealed": [],
        "axes": ["elbow", "wrist"],
        "effects": list(effects),
        "corrected": [],
        "change": None,
        "parameters": {"elbow_mass_kg": {"true": 4.8, "prior": 4.0, "prior_std": 0.16}},
        "duration_s": 200.0,
        "true_rmse": {"motor_current_A": 0.3},
        "units": [
            {"channels": {"motor_current_A": "motor_current_A"}, "scales": {}},
            {"channels": {"motor_current_A": "motor_current_mA"}, "scales": {"motor_current_A": 1000.0}},
        ],
        **other,
    }


def named(name: str = "coulomb-friction", factor: float = 1.0, **other: object) -> Answer:
    """Return one effect as an answer has it, its current in A times a factor."""
    return {
        "name": name,
        "channel": "motor_current_A" if factor == 1 else "motor_current_mA",
        "wheels": ["elbow", "wrist"],
        "onset_s": None,
        "parameters": {
            "coulomb_current": {"value": 0.21 * factor, "low": 0.19 * factor, "high": 0.23 * factor, "unit": "A"}
        },
        "rmse_before": 0.35 * factor,
        "rmse_after": 0.30 * factor,
        **other,
    }


def answer(verdict: str, *effects: Answer, factor: float = 1.0, **other: object) -> Answer:
    """Return an answer of the contract's form."""
    channel = "motor_current_A" if factor == 1 else "motor_current_mA"
    return {
        "verdict": verdict,
        "effects": list(effects),
        "unexplained": [],
        "changes": [],
        "parameters": [],
        "fit": {"channel": channel, "held_out_rmse_before": 0.35 * factor, "held_out_rmse_after": 0.302 * factor},
        **other,
    }


def verdict(sealed: Answer, *answers: Answer, first: Answer | None = None) -> Verdict:
    """Return the score of one case."""
    return judge(Outcome(sealed, list(answers), first, 1.0))


MISSING = "missing-physics"
RIGHT = answer(MISSING, named())
UNEXPLAINED = answer("unexplained", unexplained=[{"covariate": "position", "wheels": ["elbow"]}])
GROWN = truth("corrected-grown", corrected=[concealed()], change=1.8)
MORE = [{"name": "coulomb-friction", "corrected": 0.2, "now": 0.36, "low": 0.33, "high": 0.39}]
LESS = [{"name": "coulomb-friction", "corrected": 0.2, "now": 0.01, "low": -0.02, "high": 0.03}]


@pytest.mark.parametrize(
    ("sealed", "said"),
    [
        (truth("nothing"), answer("consistent")),
        (truth("single", concealed()), RIGHT),
        (truth("outside", concealed(None)), UNEXPLAINED),
        (truth("corrected-unchanged", corrected=[concealed()]), answer("consistent")),
        (GROWN, answer(MISSING, changes=MORE)),
        (truth("corrected-gone", corrected=[concealed()], change=0.0), answer(MISSING, changes=LESS)),
        (truth("corrected-new", concealed(), corrected=[concealed("viscous-friction")]), RIGHT),
        (
            truth("parameter-off"),
            answer(
                "consistent",
                parameters=[
                    {"name": "elbow_mass_kg", "prior": 4.0, "prior_std": 0.16, "value": 4.7, "low": 4.6, "high": 4.9}
                ],
            ),
        ),
    ],
    ids=lambda value: value.get("kind", ""),
)
def test_a_right_answer_is_right(sealed: Answer, said: Answer) -> None:
    """The answer that the contract asks for has no problem, whatever the kind."""
    first = answer(MISSING, *(named(effect["name"]) for effect in sealed["corrected"]))
    assert verdict(sealed, said, first=first if sealed["corrected"] else None).problems == ()


@pytest.mark.parametrize(
    ("sealed", "said", "problem"),
    [
        (truth("nothing"), RIGHT, "named coulomb-friction (missing-physics) for nothing"),
        (truth("nothing"), UNEXPLAINED, "unexplained, not consistent"),
        (truth("single", concealed()), answer("consistent"), "named nothing (consistent) for coulomb-friction"),
        (truth("single", concealed()), answer(MISSING, named("viscous-friction")), "named viscous-friction"),
        (
            truth("single", concealed()),
            answer(MISSING, named(), named("rotor-inertia")),
            "named coulomb-friction, rotor",
        ),
        (truth("pair", concealed(), concealed("rotor-inertia")), RIGHT, "for coulomb-friction, rotor-inertia"),
        (truth("single", concealed(axes=["elbow"])), RIGHT, "on elbow, wrist, not elbow"),
        (truth("single", concealed()), answer(MISSING, named(channel="load_N")), "in load_N, not motor_current_A"),
        (truth("single", concealed(onset_s=80.0)), RIGHT, "from None s, not 80 s of 200 s"),
        (truth("single", concealed(onset_s=80.0)), answer(MISSING, named(onset_s=105.0)), "from 105.0 s, not 80 s"),
        (truth("single", concealed()), answer("unexplained", named()), "unexplained, not missing-physics"),
        (truth("outside", concealed(None)), RIGHT, "named coulomb-friction for what has no name"),
        (truth("outside", concealed(None)), answer("consistent"), "consistent over what has no name"),
        (GROWN, answer("consistent"), "changed nothing, named nothing (consistent)"),
        (GROWN, answer(MISSING, changes=LESS), "is 1.8 of what it was, told otherwise"),
        (truth("corrected-gone", corrected=[concealed()], change=0.0), answer(MISSING, changes=MORE), "is 0 of what"),
        (truth("corrected-unchanged", corrected=[concealed()]), answer("consistent", changes=MORE), "changed"),
        (truth("parameter-off"), answer("consistent"), "no parameter of that name is told"),
        (truth("parameter-off"), RIGHT, "named coulomb-friction (missing-physics) for elbow_mass_kg"),
        (truth("single", concealed()), {"failed": "x\n  File y\nTypeError: z"}, "no answer: traceback ending in TypeE"),
        (truth("single", concealed()), {"failed": "no column t_s"}, "no answer: no column t_s"),
    ],
)
def test_each_error_is_told(sealed: Answer, said: Answer, problem: str) -> None:
    """Wrong, missing and surplus names, wrong places, onsets and changes are problems, in words."""
    told = verdict(sealed, said, first=answer(MISSING, named()) if sealed["corrected"] else None)
    assert not told.right
    assert any(problem in one for one in (*told.problems, *told.onset_problems)), told


def test_an_onset_that_is_off_is_told_apart_from_all_else() -> None:
    """A case with the right names and a wrong onset is not right, and right but for onsets."""
    off = verdict(truth("single", concealed(onset_s=80.0)), answer(MISSING, named(onset_s=105.0)))
    near = verdict(truth("single", concealed(onset_s=80.0)), answer(MISSING, named(onset_s=95.0)))
    score = figures([off, near])
    assert (score["right"], score["right_but_for_onsets"]) == (0.5, 1.0)


def test_consistent_over_an_effect_and_a_name_on_nothing_are_grave() -> None:
    """`consistent` is grave over 10 % and more of the mean reading, a name where nothing is concealed always."""
    assert verdict(truth("single", concealed()), answer("consistent")).consistent_over_effect
    assert not verdict(truth("single", concealed(strength=0.08)), answer("consistent")).consistent_over_effect
    assert not verdict(truth("nothing"), answer("consistent")).consistent_over_effect
    assert verdict(GROWN, answer("consistent"), first=RIGHT).consistent_over_effect
    assert verdict(truth("nothing"), RIGHT).named_on_nothing
    assert not verdict(truth("single", concealed()), RIGHT).named_on_nothing


def test_a_correction_of_something_else_is_a_problem() -> None:
    """What the first answer named wrongly is told, whatever the second one says."""
    told = verdict(
        truth("corrected-unchanged", corrected=[concealed()]),
        answer("consistent"),
        first=answer(MISSING, named("viscous-friction")),
    )
    assert told.problems == ("before the correction: named viscous-friction for coulomb-friction",)


def test_the_same_answer_in_other_units_is_the_same() -> None:
    """A thousand times the number with a thousandth of the unit is right; another interval or name is not."""
    sealed = truth("units", concealed())
    same = answer(MISSING, named(factor=1000.0), factor=1000.0)
    told = verdict(sealed, RIGHT, same)
    assert told.right
    assert told.intervals == (True, True)
    wider = deepcopy(same)
    wider["effects"][0]["parameters"]["coulomb_current"]["high"] = 300.0
    assert any("other size or interval" in one for one in verdict(sealed, RIGHT, wider).problems)
    power = {"value": 0.25, "low": None, "high": None, "unit": "1"}
    unknown, known = deepcopy(RIGHT), deepcopy(same)
    for said in (unknown, known):
        said["effects"][0]["parameters"]["power"] = dict(power)
    assert verdict(sealed, unknown, known).right
    known["effects"][0]["parameters"]["power"] |= {"low": 0.2, "high": 0.3}
    assert any("other size or interval" in one for one in verdict(sealed, unknown, known).problems)
    other = answer("consistent", factor=1000.0)
    assert any("other units, other answer" in one for one in verdict(sealed, RIGHT, other).problems)


def test_intervals_and_held_out_error_are_measured() -> None:
    """An interval holds the truth or not; a value on its own bound and a held-out error above 2 % are problems."""
    assert verdict(truth("single", concealed()), RIGHT).intervals == (True,)
    far = concealed(parameters={"coulomb_current": 0.4})
    assert verdict(truth("single", far), RIGHT).intervals == (False,)
    warm = concealed(channel="oven_degC", parameters={"relative_size": 0.1})
    told = named(
        channel="oven_degC", parameters={"relative_size": {"value": 0.3, "low": 0.2, "high": 0.4, "unit": "1"}}
    )
    units = [{"channels": {"oven_degC": "oven_degC"}, "scales": {}}]
    sealed = truth("single", warm, units=units, true_rmse={"oven_degC": 0.3})
    assert verdict(sealed, answer(MISSING, told)).intervals == ()
    edge = named(parameters={"power": {"value": 1.4, "low": 1.0, "high": 1.4, "unit": ""}})
    assert any("on the edge" in one for one in verdict(truth("single", concealed()), answer(MISSING, edge)).problems)
    worse = answer(MISSING, named(), fit={"channel": "motor_current_A", "held_out_rmse_after": 0.31})
    assert any("held-out error 1.033" in one for one in verdict(truth("single", concealed()), worse).problems)


def test_figures_count_every_case() -> None:
    """What gave no answer counts as wrong, and the shares are of those asked."""
    sealed = truth("single", concealed())
    score = figures([verdict(sealed, RIGHT), verdict(sealed, {"failed": "no"}), verdict(truth("nothing"), RIGHT)])
    assert (score["cases"], score["right"], score["named_on_nothing"]) == (3, pytest.approx(1 / 3), 1)
    assert (score["servo_joint_single_right"], score["servo_joint_single_cases"]) == (1, 2)
    assert (score["kind_nothing_right"], score["machine_servo_joint_cases"]) == (0, 3)
    assert score["no_answer"] == pytest.approx(1 / 3)
    assert score["outside_located"] is None
