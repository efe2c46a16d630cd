"""Calls of a user's code: an error is told with class, method, file and line, where they are the user's."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.candidates.viscous_friction import ViscousFriction
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.simulation.user_code import Columns, called


class Tank:
    """A simulation of a user."""

    def level(self, height_m: float) -> float:
        """Divide by 0 where it is empty."""
        return 1 / height_m


def test_an_error_of_a_user_s_class_has_its_place() -> None:
    """The innermost line of the user's own code."""
    line = Tank.level.__code__.co_firstlineno + 2
    with pytest.raises(SimulationError, match=rf"^Tank\.level \({__file__}, line {line}\): ZeroDivisionError"):
        called(Tank(), "level", 0.0)
    assert called(Tank(), "level", 2.0) == 0.5


def test_an_error_of_the_engine_s_own_class_has_no_place() -> None:
    """A candidate of the library is in another folder than the simulations."""
    with pytest.raises(SimulationError, match=r"^AttributeError: "):
        called(ViscousFriction(), "applies", None)


def test_a_column_of_text_is_not_there_as_numbers() -> None:
    """It is there: what it holds is told, and no other name is asked for."""
    columns = Columns({}, unread=["column flow_l_s holds text ('0,1' in line 2), not numbers"])
    told = str(columns.missing("flow_l_s", "the simulation needs"))
    assert "column flow_l_s, which the recording does not have as numbers; column flow_l_s holds text ('0,1'" in told
    assert "did you mean flow_l_s?" in str(Columns({"flow_l_s": np.zeros(1)}).missing("flow_ls", "it reads"))
