"""Effects on a battery's voltage are measured against how far it moves, those on a current against its mean."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest
from linear_machine import Level, table

from regolithd.calibration.mismatch import from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.readings.zero import is_far_from_zero


class Voltage(Level):
    """A voltage, of which the machine does not say what 0 V means."""

    zero_means_nothing: ClassVar[bool | None] = None


class Current(Voltage):
    """The same machine, whose column is a current."""

    unit: ClassVar[str] = "A"


def far() -> dict[str, np.ndarray]:
    """Return a recording about 370 V with a white noise of 0.2 V."""
    columns = table()
    return {**columns, "reading_V": columns["reading_V"] + 368.0}


def test_a_voltage_that_is_far_from_zero_is_measured_about_its_mean() -> None:
    """The mean magnitude of a normal noise of 0.2 is 0.16; the answer says so."""
    problem = build_problem(from_columns(far(), unit="axis"), Voltage())
    assert problem.arbitrary_zero
    assert problem.mean_size == pytest.approx(0.16, abs=0.01)
    assert any("far from 0" in note for note in problem.recording.notes)
    assert "torque" not in problem.covariates


@pytest.mark.parametrize("machine", [Current, Level])
def test_a_current_has_a_zero_and_so_has_what_the_simulation_says(machine: type[Level]) -> None:
    """However far it is from 0."""
    problem = build_problem(from_columns(far(), unit="axis"), machine())
    assert not problem.arbitrary_zero
    assert problem.mean_size == pytest.approx(370, abs=1)


def test_a_voltage_that_comes_near_zero_on_one_axis_has_a_zero() -> None:
    """Every axis has to be far, whichever side of 0 it is on; blanks say nothing."""
    one, other = np.linspace(100, 110, 50), np.linspace(-110, -100, 50)
    assert is_far_from_zero(np.stack((one, other), axis=1))
    assert is_far_from_zero(np.stack((one, np.full(50, np.nan)), axis=1))
    assert not is_far_from_zero(np.stack((one, np.linspace(-1, 10, 50)), axis=1))
    assert not is_far_from_zero(np.full((50, 1), np.nan))
