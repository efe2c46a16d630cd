"""The score of a batch: answers compared with the truth.

| group | right answer |
|---|---|
| nothing | verdict `consistent`, no name |
| single, pair | the exact set of names |
| outside (effects out of the library) | verdict `unexplained`, no name, and the right covariate or wheel |
| constant (one speed) | a set of indistinguishable effects that contains the truth, and an experiment |

Wheels and onsets are compared for effects that were named correctly, intervals for parameters that truth and answer
have in common.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable

    from regolithd.calibration.validation.blind_trials.batch import Outcome
    from regolithd.calibration.validation.blind_trials.commitment import Truth

Figures = dict[str, float | int]


@dataclass(frozen=True)
class Verdict:
    """The result of one trial; None where a question does not apply."""

    group: str
    kinds: tuple[str, ...]
    named: frozenset[str]
    exact: bool
    named_something: bool
    located: bool | None
    wheels: bool | None
    onset: bool | None
    intervals: tuple[bool, ...]
    held_out_ratio: float | None
    undecided: bool | None
    """At constant speed: whether the answer has the indistinguishable set and an experiment."""
    decided: bool | None
    """At constant speed: whether the answer after the proposed experiment has the right name, and no other."""
    seconds: float

    @property
    def right(self) -> bool:
        """Whether the answer is right for its group."""
        if self.group == "outside":
            return self.exact and bool(self.located)
        return bool(self.undecided) if self.group == "constant" else self.exact


def judge(outcome: Outcome) -> Verdict:
    """Return the result of one trial."""
    truth, answer = outcome.truth, outcome.answer["answer"]
    effects = answer.get("effects", [])
    named = frozenset(effect["name"] for effect in effects)
    wanted = frozenset(effect["name"] for effect in truth["effects"] if effect["name"])
    pairs = [(one, other) for one in truth["effects"] for other in effects if one["name"] == other["name"]]
    return Verdict(
        group=truth["group"],
        kinds=tuple(effect["kind"] for effect in truth["effects"]),
        named=named,
        exact="failed" not in answer and named == wanted and _verdict_fits(truth, answer),
        named_something=bool(named),
        located=_located(truth, answer) if truth["group"] == "outside" else None,
        wheels=all(set(one["wheels"]) == set(other["wheels"]) for one, other in pairs) if pairs else None,
        onset=_onset(truth, pairs),
        intervals=tuple(_intervals(pairs)),
        held_out_ratio=_held_out(truth, answer),
        undecided=_undecided(truth, answer) if truth["group"] == "constant" else None,
        decided=_decided(wanted, outcome) if truth["group"] == "constant" else None,
        seconds=float(outcome.answer["seconds"]),
    )


def _verdict_fits(truth: Truth, answer: dict[str, Any]) -> bool:
    """Whether the verdict is the group's: `consistent` for nothing, `unexplained` for outside, any for the others."""
    wanted = {"nothing": {"consistent"}, "outside": {"unexplained"}}.get(truth["group"])
    return wanted is None or answer.get("verdict") in wanted


def _located(truth: Truth, answer: dict[str, Any]) -> bool:
    """Whether an unexplained part has the effect's covariate or, for an effect on one wheel, that wheel."""
    (hidden,) = truth["effects"]
    for found in answer.get("unexplained", []):
        if found.get("covariate") == hidden["covariate"]:
            return True
        if len(hidden["wheels"]) == 1 and found.get("wheels") == hidden["wheels"]:
            return True
    return False


def _onset(truth: Truth, pairs: list[tuple[dict[str, Any], dict[str, Any]]]) -> bool | None:
    """Whether every onset is within 10 % of the recording's length."""
    timed = [(one["onset_s"], other.get("onset_s")) for one, other in pairs if one["onset_s"] is not None]
    if not timed:
        return None
    return all(found is not None and abs(found - at) <= 0.1 * truth["duration_s"] for at, found in timed)


def _intervals(pairs: list[tuple[dict[str, Any], dict[str, Any]]]) -> Iterable[bool]:
    """Whether each 90 % interval contains the true value, for parameters that truth and answer have in common."""
    for one, other in pairs:
        for key, true in one["parameters"].items():
            if (found := other["parameters"].get(key)) is not None:
                yield found["low"] <= true <= found["high"]


def _held_out(truth: Truth, answer: dict[str, Any]) -> float | None:
    """Held-out RMSE over the RMSE of the true model on the same recording."""
    after = answer.get("fit", {}).get("held_out_rmse_after")
    return None if after is None or truth["group"] in {"outside", "constant"} else float(after) / truth["true_rmse_A"]


def _undecided(truth: Truth, answer: dict[str, Any]) -> bool:
    """Whether the answer has an indistinguishable set of at least two with the true effect, and an experiment."""
    (hidden,) = truth["effects"]
    sets = answer.get("indistinguishable", [])
    return any(hidden["name"] in one["effects"] and len(one["effects"]) > 1 and one.get("experiment") for one in sets)


def _decided(wanted: frozenset[str], outcome: Outcome) -> bool:
    """Whether the answer after the experiment has exactly the right names."""
    answer = outcome.experiment or {}
    return frozenset(effect["name"] for effect in answer.get("effects", [])) == wanted


def share(results: Iterable[bool | None]) -> float:
    """Return the share of true values among those that are not None; NaN if all are None."""
    known = [result for result in results if result is not None]
    return sum(known) / len(known) if known else math.nan


def figures(verdicts: list[Verdict]) -> Figures:
    """Return the solver's score as one flat dictionary: shares between 0 and 1, and counts."""
    by_group = {group: [v for v in verdicts if v.group == group] for group in Counter(v.group for v in verdicts)}
    concealed = [*by_group.get("nothing", []), *by_group.get("single", []), *by_group.get("pair", [])]
    intervals = [held for verdict in verdicts for held in verdict.intervals]
    ratios = [v.held_out_ratio for v in concealed if v.held_out_ratio is not None]
    score: Figures = {
        "recordings": len(verdicts),
        "exact_set": share(v.exact for v in concealed),
        "false_name_on_nothing": share(v.named_something for v in by_group.get("nothing", [])),
        "outside_unexplained_and_located": share(v.exact and v.located for v in by_group.get("outside", [])),
        "outside_named": share(v.named_something for v in by_group.get("outside", [])),
        "wheels_right": share(v.wheels for v in verdicts if v.group != "constant"),
        "onset_within_tenth": share(v.onset for v in verdicts),
        "intervals_hold": share(intervals),
        "intervals_judged": len(intervals),
        "held_out_within_2_percent": share(ratio <= 1.02 for ratio in ratios),
        "held_out_ratio_median": sorted(ratios)[len(ratios) // 2] if ratios else math.nan,
        "constant_speed_undecided": share(v.undecided for v in by_group.get("constant", [])),
        "constant_speed_decided_by_experiment": share(v.decided for v in by_group.get("constant", [])),
        "seconds_median": sorted(v.seconds for v in verdicts)[len(verdicts) // 2] if verdicts else math.nan,
    }
    for group, those in sorted(by_group.items()):
        score[f"recordings_{group}"] = len(those)
        score[f"exact_set_{group}"] = share(v.exact for v in those)
    return score


def figures_of(outcomes: list[Outcome]) -> Figures:
    """Return the score of solver and baselines as one flat dictionary."""
    return {**figures([judge(outcome) for outcome in outcomes]), **baseline_figures(outcomes)}


def baseline_figures(outcomes: list[Outcome]) -> Figures:
    """Return the baselines' scores; the keys begin with `peer_`, which other programs read."""
    score: Figures = {}
    for baseline in sorted({name for outcome in outcomes for name in outcome.baselines if name != "failed"}):
        given = [outcome for outcome in outcomes if baseline in outcome.baselines]
        rows = [(o.truth, frozenset(o.baselines[baseline]["names"]), o.baselines[baseline]["seconds"]) for o in given]
        key = "peer_" + baseline.replace("-", "_")
        inside = [row for row in rows if row[0]["group"] in {"nothing", "single", "pair"}]
        score[f"{key}_exact_set"] = share(
            named == {effect["name"] for effect in truth["effects"]} for truth, named, _ in inside
        )
        score[f"{key}_holds_the_truth"] = share(
            {e["name"] for e in truth["effects"]} <= named for truth, named, _ in inside if truth["effects"]
        )
        score[f"{key}_false_name_on_nothing"] = share(bool(n) for t, n, _ in rows if t["group"] == "nothing")
        score[f"{key}_outside_named"] = share(bool(n) for t, n, _ in rows if t["group"] == "outside")
        score[f"{key}_seconds_median"] = sorted(row[2] for row in rows)[len(rows) // 2]
    return score
