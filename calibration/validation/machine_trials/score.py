"""What counts as right, by the contract: names, axes, channel, onset, held-out error, and no value on its bound.

Each thing that is wrong with an answer is one sentence; a case is right when there is none. `consistent` over an effect
of 10 % of the mean reading is the gravest error, a name where nothing is concealed the next.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from regolithd.calibration.validation.blind_trials.commitment import Truth
    from regolithd.calibration.validation.machine_trials.batch import Outcome

Answer = dict[str, Any]
Figures = dict[str, float | int | None]

GRAVE_STRENGTH = 0.10
HELD_OUT_TOLERANCE, ONSET_TOLERANCE, UNITS_TOLERANCE = 1.02, 0.10, 0.05
ARBITRARY_ZERO = "_degC"
"""How channels of the machines end whose zero is a convention."""
PARTLY_MEASURED = {"slow", "blank"}
"""Kinds in which the tool may leave rows out, so that its held-out error is of other rows than the truth's."""


@dataclass(frozen=True)
class Verdict:
    """How one case came out."""

    machine: str
    kind: str
    index: int
    problems: tuple[str, ...]
    onset_problems: tuple[str, ...]
    named: tuple[str, ...]
    verdict: str
    named_on_nothing: bool
    consistent_over_effect: bool
    located: bool | None
    intervals: tuple[bool, ...]
    parameter_intervals: tuple[bool, ...]
    held_out_ratio: float | None
    seconds: float

    @property
    def right(self) -> bool:
        """Whether nothing is wrong with it."""
        return not self.problems and not self.onset_problems


def judge(outcome: Outcome) -> Verdict:
    """Return how the solver did on one case."""
    truth, last = outcome.truth, outcome.answers[0]
    problems = [*first_problems(truth, outcome.first)] if outcome.first is not None else []
    for at, said in enumerate(outcome.answers):
        where = "in other units: " if at else ""
        problems += [where + problem for problem in answer_problems(truth, said, at)]
    problems += units_problems(outcome.answers)
    nothing = not truth["effects"] and truth["change"] is None
    return Verdict(
        truth["machine"],
        truth["kind"],
        truth["index"],
        tuple(problems),
        tuple(problem for said in outcome.answers for problem in onset_problems(truth, said)),
        tuple(sorted(names(last))),
        "no answer" if "failed" in last else str(last.get("verdict")),
        nothing and any(names(said) for said in outcome.answers),
        any(said.get("verdict") == "consistent" for said in outcome.answers)
        and concealed_strength(truth) >= GRAVE_STRENGTH,
        located(truth, last) if truth["kind"] == "outside" else None,
        tuple(intervals(truth, outcome.answers)),
        tuple(parameter_intervals(truth, last)),
        held_out_ratio(truth, last, 0),
        outcome.seconds,
    )


def names(said: Answer) -> set[str]:
    """Return the names of an answer's effects."""
    return {effect["name"] for effect in said.get("effects", [])}


def concealed_strength(truth: Truth) -> float:
    """Return how strong the strongest thing is that the last answer should tell."""
    ratio = 1.0 if truth["change"] is None else truth["change"]
    changed = [abs(ratio - 1) * one["strength"] for one in truth["corrected"]]
    return max([0.0, *changed, *(effect["strength"] for effect in truth["effects"])])


def first_problems(truth: Truth, said: Answer) -> Iterator[str]:
    """Yield what is wrong with the answer that a corrected simulation was made from."""
    wanted = {effect["name"] for effect in truth["corrected"]}
    if "failed" not in said and names(said) != wanted:
        yield f"before the correction: named {listed(names(said))} for {listed(wanted)}"


def answer_problems(truth: Truth, said: Answer, at: int) -> Iterator[str]:
    """Yield what is wrong with one answer, in unit system `at`."""
    if "failed" in said:
        yield f"no answer: {message(said)}"
        return
    kind = truth["kind"]
    if kind == "outside":
        yield from outside_problems(said)
    elif kind == "parameter-off":
        yield from parameter_problems(truth, said)
    elif truth["change"] is not None:
        yield from change_problems(truth, said)
    else:
        yield from name_problems(truth, said, at)
        if said.get("changes"):
            yield f"says that {listed({one['name'] for one in said['changes']})} changed"
    yield from bound_problems(said)


def message(said: Answer) -> str:
    """Return what the user saw: the whole message, or a traceback's last line."""
    lines = said["failed"].strip().splitlines() or [""]
    return f"traceback ending in {lines[-1]}" if any(one.startswith("  File ") for one in lines) else " ".join(lines)


def outside_problems(said: Answer) -> Iterator[str]:
    """Yield what is wrong with an answer to an effect that has no name."""
    if names(said):
        yield f"named {listed(names(said))} for what has no name"
    elif said.get("verdict") != "unexplained" or not said.get("unexplained"):
        yield f"{said.get('verdict')} over what has no name"


def name_problems(truth: Truth, said: Answer, at: int) -> Iterator[str]:
    """Yield wrong names, verdicts, axes, channels, onsets and held-out errors."""
    wanted = {effect["name"] for effect in truth["effects"]}
    if names(said) != wanted:
        yield f"named {listed(names(said))} ({said.get('verdict')}) for {listed(wanted)}"
        return
    verdict = "missing-physics" if wanted else "consistent"
    if said.get("verdict") != verdict:
        yield f"{said.get('verdict')}, not {verdict}"
    for true, found in matched(truth, said):
        yield from effect_problems(truth, true, found, at)
    ratio = held_out_ratio(truth, said, at)
    if ratio is not None and ratio > HELD_OUT_TOLERANCE:
        yield f"held-out error {ratio:.3f} of the true model's"


def effect_problems(truth: Truth, true: Answer, found: Answer, at: int) -> Iterator[str]:
    """Yield what is wrong with one rightly named effect."""
    if truth["axes"] and {str(axis) for axis in found.get("wheels", [])} != set(true["axes"]):
        yield f"{true['name']} on {listed(found.get('wheels', []))}, not {listed(true['axes'])}"
    channel = truth["units"][at]["channels"][true["channel"]]
    if found.get("channel") != channel:
        yield f"{true['name']} in {found.get('channel')}, not {channel}"


def onset_problems(truth: Truth, said: Answer) -> Iterator[str]:
    """Yield the onsets of rightly named effects that are not within a tenth of the recording's length."""
    for true, found in matched(truth, said):
        onset = found.get("onset_s")
        if true["onset_s"] is None:
            continue
        if onset is None or abs(onset - true["onset_s"]) > ONSET_TOLERANCE * truth["duration_s"]:
            yield f"{true['name']} from {onset} s, not {true['onset_s']:.0f} s of {truth['duration_s']:.0f} s"


def parameter_problems(truth: Truth, said: Answer) -> Iterator[str]:
    """Yield what is wrong with an answer to a parameter far from its prior: it must be found, and nothing else."""
    away = {name: abs(one["true"] - one["prior"]) / one["prior_std"] for name, one in truth["parameters"].items()}
    off = max(away, key=lambda name: away[name])
    if names(said) or said.get("unexplained"):
        yield f"named {listed(names(said))} ({said.get('verdict')}) for {off} at {away[off]:.1f} deviations"
    found = next((one for one in said.get("parameters", []) if one["name"] == off), None)
    if found is None:
        yield f"{off} is at {away[off]:.1f} deviations, and no parameter of that name is told"
    elif abs(found["value"] - found["prior"]) <= 3 * found["prior_std"]:
        moved = abs(found["value"] - found["prior"]) / found["prior_std"]
        yield f"{off} is at {away[off]:.1f} deviations, told {moved:.1f}"


def change_problems(truth: Truth, said: Answer) -> Iterator[str]:
    """Yield what is wrong with an answer to a corrected effect that has grown or gone."""
    wanted = {effect["name"] for effect in truth["corrected"]}
    changed = {one["name"] for one in said.get("changes", [])}
    if changed != wanted or names(said) - wanted:
        yield f"changed {listed(changed)}, named {listed(names(said))} ({said.get('verdict')}) for {listed(wanted)}"
        return
    if said.get("verdict") != "missing-physics":
        yield f"{said.get('verdict')}, not missing-physics"
    if not any(tells_change(truth["change"], one) for one in said["changes"]):
        yield f"{listed(wanted)} is {truth['change']:g} of what it was, told otherwise"


def tells_change(ratio: float, told: Answer) -> bool:
    """Return whether a change is told in its direction: nothing left, or more with what was corrected excluded."""
    low, high = sorted((abs(told["low"]), abs(told["high"])))
    if ratio == 0:
        return bool(told["low"] <= 0 <= told["high"] or abs(told["now"]) < 0.1 * abs(told["corrected"]))
    return bool(low > abs(told["corrected"]) if ratio > 1 else high < abs(told["corrected"]))


def bound_problems(said: Answer) -> Iterator[str]:
    """Yield values that stand on the edge of their own interval, or outside it."""
    for effect in said.get("effects", []):
        for key, one in effect.get("parameters", {}).items():
            if None not in {one.get("low"), one.get("high")} and not one["low"] < one["value"] < one["high"]:
                yield f"{effect['name']}: {key} {one['value']:.4g} on the edge of [{one['low']:.4g}, {one['high']:.4g}]"


def units_problems(answers: list[Answer]) -> Iterator[str]:
    """Yield what differs between two unit systems, in what has no unit or only a factor."""
    if len(answers) < 2 or any("failed" in said for said in answers):
        return
    one, other = answers[:2]
    if (one.get("verdict"), names(one)) != (other.get("verdict"), names(other)):
        yield f"other units, other answer: {listed(names(one))} against {listed(names(other))}"
        return
    there = {effect["name"]: effect for effect in other["effects"]}
    for effect in one["effects"]:
        here, again = shape_of(effect), shape_of(there[effect["name"]])
        if here.keys() != again.keys() or any(abs(here[key] - again[key]) > UNITS_TOLERANCE for key in here):
            yield f"other units, other size or interval of {effect['name']}"


def shape_of(effect: Answer) -> dict[str, float]:
    """Return what a change of unit leaves: ratios of interval to value, without temperatures, whose zero moves.

    A number without an interval has no ratio.
    """
    kept = {
        key: one
        for key, one in effect.get("parameters", {}).items()
        if one["value"] and not any(degree in one.get("unit", "") for degree in ("°", "deg", "K"))
    }
    ends = [(key, end) for key, one in kept.items() for end in ("low", "high") if one[end] is not None]
    ratios = {f"{key} {end}": kept[key][end] / kept[key]["value"] for key, end in ends}
    return {**ratios, "rmse": effect["rmse_after"] / effect["rmse_before"]}


def located(truth: Truth, said: Answer) -> bool:
    """Return whether the unexplained is where it is: its covariate, or, for one axis alone, its axis."""
    (hidden,) = truth["effects"]
    alone = len(truth["axes"]) > 1 and len(hidden["axes"]) == 1
    return any(
        found.get("covariate") == hidden["covariate"] or (alone and found.get("wheels") == hidden["axes"])
        for found in said.get("unexplained", [])
    )


def matched(truth: Truth, said: Answer) -> list[tuple[Answer, Answer]]:
    """Return the pairs of concealed and found effects that have the same name."""
    return [
        (one, other) for one in truth["effects"] for other in said.get("effects", []) if one["name"] == other["name"]
    ]


def intervals(truth: Truth, answers: list[Answer]) -> Iterator[bool]:
    """Yield whether each 90 % interval holds the true value, where truth and answer share it by name.

    A relative size is not judged where the channel's zero is arbitrary: there it is relative to the mean distance from
    the mean, in the answer, and to the mean reading, in the truth.
    """
    for at, said in enumerate(answers):
        scales = truth["units"][at]["scales"]
        for one, other in matched(truth, said):
            factor = scales.get(one["channel"], 1.0)
            for key, true in one["parameters"].items():
                if key == "relative_size" and one["channel"].endswith(ARBITRARY_ZERO):
                    continue
                if (found := other.get("parameters", {}).get(key)) is not None:
                    value = true * (factor if key in {"coulomb_current", "coulomb_torque"} else 1.0)
                    yield bool(found["low"] <= value <= found["high"])


def parameter_intervals(truth: Truth, said: Answer) -> Iterator[bool]:
    """Yield whether the interval of each of the simulation's parameters holds the true value; where names are right."""
    if "failed" in said or names(said) != {effect["name"] for effect in truth["effects"]} or truth["kind"] == "outside":
        return
    for one in said.get("parameters", []):
        if (known := truth["parameters"].get(one["name"])) is not None:
            yield bool(one["low"] <= known["true"] <= one["high"])


def held_out_ratio(truth: Truth, said: Answer, at: int) -> float | None:
    """Return the worst held-out RMSE over what the true model leaves; None where rows may differ or none is told."""
    if truth["kind"] in PARTLY_MEASURED or truth["kind"] in {"outside", "parameter-off"} or truth["change"] is not None:
        return None
    fits = said.get("fit") or []
    units = truth["units"][at]
    ratios = [
        fit["held_out_rmse_after"] / (true * units["scales"].get(channel, 1.0))
        for fit in (fits if isinstance(fits, list) else [fits])
        for channel, true in truth["true_rmse"].items()
        if fit.get("channel") == units["channels"][channel] and fit.get("held_out_rmse_after") is not None
    ]
    return max(ratios, default=None)


def listed(values: Iterable[object]) -> str:
    """Return names for people."""
    return ", ".join(sorted(str(value) for value in values)) or "nothing"


def share(answers: Iterable[bool | None]) -> float | None:
    """Return how many of the questions that arose were answered yes; None if none arose."""
    asked = [answer for answer in answers if answer is not None]
    return sum(asked) / len(asked) if asked else None


def figures(verdicts: list[Verdict]) -> Figures:
    """Return the score as one flat object: shares between 0 and 1, and how many each is a share of."""
    score: Figures = {
        "cases": len(verdicts),
        "right": share(v.right for v in verdicts),
        "right_but_for_onsets": share(not v.problems for v in verdicts),
        "no_answer": share(v.verdict == "no answer" for v in verdicts),
        "consistent_over_effect": sum(v.consistent_over_effect for v in verdicts),
        "named_on_nothing": sum(v.named_on_nothing for v in verdicts),
        "outside_located": share(v.located for v in verdicts),
        "intervals_hold": share(held for v in verdicts for held in v.intervals),
        "intervals_judged": sum(len(v.intervals) for v in verdicts),
        "parameter_intervals_hold": share(held for v in verdicts for held in v.parameter_intervals),
        "parameter_intervals_judged": sum(len(v.parameter_intervals) for v in verdicts),
        "held_out_within_2_percent": share(
            None if v.held_out_ratio is None else v.held_out_ratio <= HELD_OUT_TOLERANCE for v in verdicts
        ),
        "seconds_median": sorted(v.seconds for v in verdicts)[len(verdicts) // 2] if verdicts else math.nan,
    }
    cells: dict[str, list[bool]] = {}
    for v in verdicts:
        kind, machine = v.kind.replace("-", "_"), v.machine.replace("-", "_")
        for key in (f"kind_{kind}", f"machine_{machine}", f"{machine}_{kind}"):
            cells.setdefault(key, []).append(v.right)
    for key, rights in sorted(cells.items()):
        score |= {f"{key}_right": sum(rights), f"{key}_cases": len(rights)}
    return score
