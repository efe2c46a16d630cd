"""The reliability diagram: what counts as right, the ranges of probability, and the files of a batch."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from regolithd.calibration.validation.reliability import Bin, Stated, answers_of, bins, is_right, main

if TYPE_CHECKING:
    from pathlib import Path

NOTHING = {"machine": "oven", "effects": [], "corrected": [], "change": None}
DRAG = {**NOTHING, "effects": [{"name": "coulomb-friction"}]}
UNKNOWN = {**NOTHING, "effects": [{"name": None}]}
GROWN = {**NOTHING, "corrected": [{"name": "viscous-friction"}], "change": 2.0}


def answer(verdict: str, *names: str, changes: tuple[str, ...] = (), probability: float = 0.9) -> dict[str, Any]:
    """Return as much of an answer as is read."""
    return {
        "verdict": verdict,
        "effects": [{"name": name} for name in names],
        "changes": [{"name": name} for name in changes],
        "probability": probability,
    }


@pytest.mark.parametrize(
    ("truth", "said", "right"),
    [
        (NOTHING, answer("consistent"), True),
        (NOTHING, answer("missing-physics"), True),
        (NOTHING, answer("unexplained"), False),
        (NOTHING, answer("missing-physics", "coulomb-friction"), False),
        (DRAG, answer("missing-physics", "coulomb-friction"), True),
        (DRAG, answer("missing-physics", "viscous-friction"), False),
        (DRAG, answer("unexplained", "coulomb-friction"), False),
        (UNKNOWN, answer("unexplained"), True),
        (UNKNOWN, answer("unexplained", "coulomb-friction"), False),
        (UNKNOWN, answer("consistent"), False),
        (GROWN, answer("missing-physics", changes=("viscous-friction",)), True),
        (GROWN, answer("consistent"), False),
        ({"group": "outside", "effects": [{"name": "voltage"}]}, answer("unexplained"), True),
    ],
)
def test_an_answer_is_right_when_its_set_of_names_is(truth: dict[str, Any], said: dict[str, Any], right: bool) -> None:
    """A parameter that left its prior is no name; what has no name stays unexplained."""
    assert is_right(truth, said) is right


def test_answers_are_counted_by_their_probability() -> None:
    """Each range with answers has their number, their mean and the share that is right."""
    found = bins([Stated(0.92, True), Stated(0.94, False), Stated(1.0, True), Stated(0.2, False)])
    assert [(each.low, each.count, each.right) for each in found] == [(0.0, 1, 0.0), (0.9, 2, 0.5), (0.95, 1, 1.0)]
    assert found[1].stated == pytest.approx(0.93)


def test_batches_become_a_table_figures_and_a_picture(tmp_path: Path) -> None:
    """Of both kinds of batch; recordings at one constant speed and answers without a probability are left out."""
    for folder in ("opened", "answers"):
        (tmp_path / folder).mkdir()
    rows = [
        (DRAG, {"answers": [answer("missing-physics", "coulomb-friction")]}),
        ({"group": "nothing", "effects": []}, {"answer": answer("consistent", probability=0.97)}),
        ({"group": "constant", "effects": [{"name": "viscous-friction"}]}, {"answer": answer("consistent")}),
        (UNKNOWN, {"answers": [{**answer("unexplained"), "probability": None}]}),
    ]
    for number, (truth, told) in enumerate(rows):
        (tmp_path / "opened" / f"{number:04d}.json").write_text(json.dumps({"truth": truth}))
        (tmp_path / "answers" / f"{number:04d}.json").write_text(json.dumps(told))
    assert answers_of(tmp_path) == [Stated(0.9, True), Stated(0.97, True)]
    main(str(tmp_path / "figures.json"), str(tmp_path / "picture.svg"), str(tmp_path))
    assert json.loads((tmp_path / "figures.json").read_text())["right_of_sure"] == 1.0
    drawn = (tmp_path / "picture.svg").read_text()
    assert drawn.count("<circle") == drawn.count('class="expected"') == 2


@pytest.mark.parametrize(("count", "low", "high"), [(1, 0.0, 1.0), (1000, 0.88, 0.92)])
def test_few_answers_say_little_about_a_stated_probability(count: int, low: float, high: float) -> None:
    """Nineteen times in twenty their share is within these bounds, of a true 0.9."""
    found = Bin(0.8, 0.95, count, 0.9, 1.0).expected
    assert found == pytest.approx((low, high), abs=0.005)
