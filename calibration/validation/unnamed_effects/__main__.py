"""Empirical curves and suggested closed forms on recordings with one effect out of the library.

    python -m regolithd.calibration.validation.unnamed_effects --seed 1 --of-each 2

Prints, for each recording, the held-out error with the empirical curve over what the true model leaves, and the place
of the right closed form among the suggestions. No candidate of the library is looked for, unless `--library` is given:
whether a name is given is the question of `make prove`, and takes ten times as long.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.mismatch.answer import Suggestion
from regolithd.calibration.mismatch.calibration.linearised import linearised_where_it_fits
from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.empirical.found import curves_of
from regolithd.calibration.mismatch.fleet.work.found import one_channel
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve
from regolithd.calibration.mismatch.selection.decision import decide
from regolithd.calibration.validation.unnamed_effects.picture import draw
from regolithd.calibration.validation.unnamed_effects.recordings import (
    RIGHT_FORM,
    Concealed,
    machine_recordings,
    rover_recordings,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

Found = tuple[str, EmpiricalCurve, tuple[Suggestion, ...]]
"""Covariate, curve and suggestions."""
WITHIN = 1.05
"""Held-out error over the true model's up to which the curve is as good as the law."""


@dataclass(frozen=True)
class Outcome:
    """What was found in one recording.

    Attributes
    ----------
    covariate: what the answer says that it follows; empty where nothing was found
    before, after: held-out error without and with the curve over what the true model leaves; 0 without a curve
    forms: families of the suggestions
    place: of the right one among them, from 1; 0: it is not among them
    """

    machine: str
    kind: str
    covariate: str
    before: float
    after: float
    forms: tuple[str, ...]
    place: int


def outcome_of(concealed: Concealed, *, library: bool) -> Outcome:
    """Return what is found in one recording."""
    found = with_library(concealed) if library else without_library(concealed)
    if found is None:
        return Outcome(concealed.machine, concealed.kind, "", 0.0, 0.0, (), 0)
    covariate, curve, suggestions = found
    right = [concealed.is_right(each.form, each.equation) for each in suggestions]
    return Outcome(
        machine=concealed.machine,
        kind=concealed.kind,
        covariate=covariate,
        before=curve.held_out_rmse_before / concealed.true_rmse,
        after=curve.held_out_rmse_after / concealed.true_rmse,
        forms=tuple(each.form for each in suggestions),
        place=right.index(True) + 1 if any(right) else 0,
    )


def with_library(concealed: Concealed) -> Found | None:
    """Compare with the whole library, and return the largest curve of the channel; None where there is none."""
    answer = compare(concealed.recording, concealed.simulation).answer
    places = [each for each in answer.unexplained if each.channel == concealed.channel]
    for place in sorted(places, key=lambda each: -each.share_of_residual):
        if place.curve is not None:
            return place.covariate, place.curve, place.suggestions
    return None


def without_library(concealed: Concealed) -> Found | None:
    """Decide without any candidate, and return the curve; None where nothing is significant."""
    simulation = one_channel(concealed.simulation, concealed.channel)
    equations = linearised_where_it_fits(lambda values: build_problem(concealed.recording, simulation, values))
    decision = decide(equations, ())
    for found in curves_of(decision):
        return found.terms[0].name, found.curve, found.suggestions
    return None


def summary(outcomes: Sequence[Outcome]) -> list[str]:
    """Return the figures as lines."""
    found = [each for each in outcomes if each.covariate]
    lawful = [each for each in found if each.kind in RIGHT_FORM]
    after = np.array([each.after for each in found])
    near = int(np.sum(after <= WITHIN))
    first_three, first = sum(each.place > 0 for each in lawful), sum(each.place == 1 for each in lawful)
    largest, median, without = after.max(), np.median(after), np.median([each.before for each in found])
    curve = (
        f"median {median:.3f}, largest {largest:.3f}; within 5 % in {near} of {len(found)} ({near / len(found):.0%})"
    )
    three = f"{first_three} of {len(lawful)} ({first_three / len(lawful):.0%})"
    return [
        f"recordings {len(outcomes)}, with something unexplained {len(found)}",
        f"held-out error with the empirical curve over the true model's: {curve}",
        f"held-out error without it over the true model's: median {without:.3f}",
        f"right closed form among the first three: {three}; first: {first} ({first / len(lawful):.0%})",
    ]


def row(each: Outcome) -> str:
    """Return one recording as a line."""
    place = "–" if each.kind not in RIGHT_FORM else (f"{each.place}" if each.place else "no")
    where = each.covariate or "nothing found"
    return (
        f"{each.machine:16} {each.kind:18} {where:14} {each.before:6.3f} {each.after:6.3f} {place:3} "
        f"{', '.join(each.forms)}"
    )


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--of-each", type=int, default=2, help="recordings of each kind of the rover's effects")
    parser.add_argument("--library", action="store_true", help="look for the library's candidates too")
    parser.add_argument("--figures", type=Path, default=Path("build/figures/unnamed.json"))
    parser.add_argument("--picture", type=Path, default=Path("build/figures/unnamed.svg"))
    options = parser.parse_args()
    outcomes = []
    with tempfile.TemporaryDirectory() as folder:
        recordings = chain(
            machine_recordings(options.seed, Path(folder)), rover_recordings(options.seed, options.of_each)
        )
        for concealed in recordings:
            outcomes.append(outcome_of(concealed, library=options.library))
            print(row(outcomes[-1]), flush=True)  # noqa: T201  # a command line
    print("\n".join(summary(outcomes)))  # noqa: T201
    options.figures.parent.mkdir(parents=True, exist_ok=True)
    told_all = {"seed": options.seed, "summary": summary(outcomes), "recordings": [asdict(each) for each in outcomes]}
    options.figures.write_text(json.dumps(told_all, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    draw(outcomes, options.picture)


if __name__ == "__main__":
    main()
