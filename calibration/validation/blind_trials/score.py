"""The score: what counts as right, by the contract.

Right is the exact set of names; on nothing, no name at all; on what has no name, no name either, but the place. Wheels
and onset are judged on what was rightly named; intervals where the truth has a value in the contract's own terms.
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
    """How one trial came out. None where a question does not arise."""

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
    """On one constant speed: whether the answer says what cannot be told apart, with an experiment."""
    decided: bool | None
    """Whether the experiment that it proposed, once driven, led to the right name."""
    seconds: float

    @property
    def right(self) -> bool:
        """Whether the trial as a whole came out as the contract asks of its group."""
        if self.group == "outside":
            return self.exact and bool(self.located)
        return bool(self.undecided) if self.group == "constant" else self.exact


def judge(outcome: Outcome) -> Verdict:
    """Return how the solver did on one trial."""
    truth, said = outcome.truth, outcome.answer["answer"]
    effects = said.get("effects", [])
    named = frozenset(effect["name"] for effect in effects)
    wanted = frozenset(effect["name"] for effect in truth["effects"] if effect["name"])
    pairs = [(one, other) for one in truth["effects"] for other in effects if one["name"] == other["name"]]
    return Verdict(
        group=truth["group"],
        kinds=tuple(effect["kind"] for effect in truth["effects"]),
        named=named,
        exact="failed" not in said and named == wanted and _verdict_fits(truth, said),
        named_something=bool(named),
        located=_located(truth, said) if truth["group"] == "outside" else None,
        wheels=all(set(one["wheels"]) == set(other["wheels"]) for one, other in pairs) if pairs else None,
        onset=_onset(truth, pairs),
        intervals=tuple(_intervals(pairs)),
        held_out_ratio=_held_out(truth, said),
        undecided=_undecided(truth, said) if truth["group"] == "constant" else None,
        decided=_decided(wanted, outcome) if truth["group"] == "constant" else None,
        seconds=float(outcome.answer["seconds"]),
    )


def _verdict_fits(truth: Truth, said: dict[str, Any]) -> bool:
    """On nothing the verdict must be `consistent`, on what has no name `unexplained`; names speak for themselves."""
    wanted = {"nothing": {"consistent"}, "outside": {"unexplained"}}.get(truth["group"])
    return wanted is None or said.get("verdict") in wanted


def _located(truth: Truth, said: dict[str, Any]) -> bool:
    """Whether the unexplained is where it is: its covariate; or, for one wheel's trouble, its wheel."""
    (hidden,) = truth["effects"]
    for found in said.get("unexplained", []):
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
    """Whether each 90 % interval holds the true value, for the values that truth and answer share by name and unit."""
    for one, other in pairs:
        for key, true in one["parameters"].items():
            if (found := other["parameters"].get(key)) is not None:
                yield found["low"] <= true <= found["high"]


def _held_out(truth: Truth, said: dict[str, Any]) -> float | None:
    """Held-out RMSE over what the true model leaves of the same recording."""
    after = said.get("fit", {}).get("held_out_rmse_after")
    return None if after is None or truth["group"] in {"outside", "constant"} else float(after) / truth["true_rmse_A"]


def _undecided(truth: Truth, said: dict[str, Any]) -> bool:
    """Whether a set of at least two that holds the truth is called indistinguishable, with an experiment."""
    (hidden,) = truth["effects"]
    sets = said.get("indistinguishable", [])
    return any(hidden["name"] in one["effects"] and len(one["effects"]) > 1 and one.get("experiment") for one in sets)


def _decided(wanted: frozenset[str], outcome: Outcome) -> bool:
    """Whether the experiment led to the right name, and to no other."""
    said = outcome.experiment or {}
    return frozenset(effect["name"] for effect in said.get("effects", [])) == wanted


def share(answers: Iterable[bool | None]) -> float:
    """Return how many of the questions that arose were answered yes; NaN if none arose."""
    asked = [answer for answer in answers if answer is not None]
    return sum(asked) / len(asked) if asked else math.nan


def figures(verdicts: list[Verdict]) -> Figures:
    """Return the score as one flat object: shares between 0 and 1, and how many each is a share of."""
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
    """Return the whole score, solver and peers, as one flat object."""
    return {**figures([judge(outcome) for outcome in outcomes]), **peer_figures(outcomes)}


def peer_figures(outcomes: list[Outcome]) -> Figures:
    """Return the peers' rows: exact set, names on nothing, and the unknown taken for something known."""
    score: Figures = {}
    for peer in sorted({name for outcome in outcomes for name in outcome.peers if name != "failed"}):
        given = [outcome for outcome in outcomes if peer in outcome.peers]
        rows = [(o.truth, frozenset(o.peers[peer]["names"]), o.peers[peer]["seconds"]) for o in given]
        key = "peer_" + peer.replace("-", "_")
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
