"""The study of thresholds: one halved and doubled on a batch of blind trials, continued where it was interrupted."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import pytest

from regolithd.calibration.mismatch.thresholds import THRESHOLDS
from regolithd.calibration.validation.blind_trials import thresholds as study

if TYPE_CHECKING:
    from pathlib import Path

    from regolithd.calibration.mismatch.thresholds import Thresholds


def test_a_threshold_is_multiplied_and_the_others_stay() -> None:
    """Whole numbers stay whole, and at least one."""
    changed = study.changed("further_share", 2.0)
    assert changed.further_share == pytest.approx(0.02)
    assert changed.smallest_effect == THRESHOLDS.smallest_effect
    assert study.changed("folds", 0.5).folds == 2
    assert study.changed("triple_breadth", 0.1).triple_breadth == 1


def test_only_known_thresholds_are_studied() -> None:
    """None named is all of them."""
    assert [one.name for one in study.chosen(["folds"])] == ["folds"]
    assert len(study.chosen([])) == len(THRESHOLDS.table())
    with pytest.raises(ValueError, match="no threshold nonsense"):
        study.chosen(["nonsense"])


class Consistent:
    """A comparison that finds nothing, whatever it is given."""

    def __init__(self) -> None:
        self.asked: list[float] = []
        self.answer = self

    def __call__(self, *_: object, thresholds: Thresholds) -> Consistent:
        """Remember the threshold that it was asked with."""
        self.asked.append(thresholds.smallest_effect)
        return self

    def to_json(self) -> dict[str, object]:
        """Return the answer."""
        return {"verdict": "consistent", "effects": [], "fit": {"held_out_rmse_after": 1.0}}


def test_the_table_has_a_row_for_the_values_in_use_and_one_for_each_threshold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second run reads the results of the first."""
    solver = Consistent()
    monkeypatch.setattr(study, "compare", solver)
    small = study.Study(tmp_path, seed=3, recordings=2, duration_s=60.0)
    with ThreadPoolExecutor(1) as workers:
        lines = list(study.rows(small, study.chosen(["smallest_effect"]), workers))
        assert len(lines) == 4
        assert lines[2].startswith("| in use |")
        assert lines[3].startswith("| `smallest_effect` | 0.02 |")
        assert len({line.count("|") for line in lines}) == 1
        trials = len(small.plans())
        assert solver.asked == [0.02] * trials + [0.01] * trials + [0.04] * trials
        assert list(study.rows(small, study.chosen(["smallest_effect"]), workers)) == lines
    assert len(solver.asked) == 3 * trials
