"""The season of the fleet study: what its rovers conceal, drive for drive."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.validation.fleet_study.season import ROVERS, Drive, drives, trial_of

DURATION_S = 20.0


def sizes(drives: dict[int, Drive]) -> dict[str, list[float]]:
    """Return the sizes of what each rover conceals, in the order of its drives; 0 where it conceals nothing."""
    found: dict[str, list[float]] = {}
    for number, drive in drives.items():
        effects = trial_of(3, number, drive, DURATION_S).effects
        found.setdefault(drive.rover, []).append(effects[0].size if effects else 0.0)
    return found


def test_law_has_one_coefficient() -> None:
    """What a rover conceals has the same coefficient on all drives, once it is at its full size, however cold it is."""
    found = sizes({number: drive for number, drive in enumerate(drives(4)) if drive.rover in {"cleo", "dara"}})
    assert len(set(found["cleo"])) == 1
    assert found["cleo"][0] > 0
    assert found["dara"][:2] == [0.0, 0.0]
    assert len(set(found["dara"][2:])) == 1


def test_growing_drag() -> None:
    """A bearing's drag is 0 until it begins, and then in proportion to the time since, on its wheel alone."""
    asper = {number: drive for number, drive in enumerate(drives(8)) if drive.rover == "asper"}
    found = np.array(sizes(asper)["asper"])
    since = np.array([drive.share for drive in asper.values()]) - ROVERS["asper"].since
    assert (found[since < 0] == 0).all()
    assert found[since > 0] / since[since > 0] == pytest.approx(found[-1] / since[-1])
    added = trial_of(3, 7, asper[7], DURATION_S).effects[0]
    current = added.added_current_A(added.size)
    assert current[:, 3].any()
    assert not np.delete(current, 3, axis=1).any()
