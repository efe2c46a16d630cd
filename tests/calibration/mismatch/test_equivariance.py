"""The answer does not depend on the order of rows, on the origin of time, or on which side is which."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rover_drives import columns, simulation

from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.data.recording import from_columns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from regolithd.calibration.mismatch.answer import Answer

LENGTH_S = 240.0
ONE_SIDE_IS_THE_OTHER = {1: 2, 2: 1, 3: 4, 4: 3, 5: 6, 6: 5}


@cache
def worn() -> dict[str, NDArray[np.float64]]:
    """Return a drive in which wheel 3 drags from half of it on."""
    table = columns(8, length_s=LENGTH_S)
    drag = 0.8 * np.mean(np.abs(table["motor_current_A"])) * np.sign(table["motor_speed_rad_s"])
    later = (table["wheel"] == 3) & (table["t_s"] > LENGTH_S / 2)
    return {**table, "motor_current_A": table["motor_current_A"] + drag * later}


@cache
def as_it_was() -> Answer:
    """Return what is said of that drive."""
    return compare(from_columns(worn()), simulation()).answer


@settings(max_examples=3, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(shuffle=st.integers(0, 2**32 - 1), origin_s=st.floats(-1e6, 1e9), mirrored=st.booleans())
def test_the_answer_does_not_hang_on_how_the_recording_is_written(
    shuffle: int, origin_s: float, *, mirrored: bool
) -> None:
    """Names, wheels, onsets and sizes stay; a mirrored rover has its fault on the other side."""
    table = dict(worn())
    if mirrored:
        table["wheel"] = np.vectorize(ONE_SIDE_IS_THE_OTHER.__getitem__)(table["wheel"].astype(int)).astype(float)
        table |= {name: -table[name] for name in ("roll_rad", "yaw_rate_rad_s")}
    table["t_s"] = table["t_s"] + origin_s
    order = np.random.default_rng(shuffle).permutation(len(table["t_s"]))
    answer = compare(from_columns({name: values[order] for name, values in table.items()}), simulation()).answer
    expected = as_it_was()
    assert [e.name for e in expected.effects] == ["bearing-drag"]
    assert answer.verdict == expected.verdict
    for now, before in zip(answer.effects, expected.effects, strict=True):
        assert now.name == before.name
        assert now.wheels == tuple(ONE_SIDE_IS_THE_OTHER[w] if mirrored else w for w in before.wheels)
        assert now.onset_s == pytest.approx(before.onset_s, abs=0.2)
        assert now.parameters["relative_size"].value == pytest.approx(
            before.parameters["relative_size"].value, rel=1e-3
        )
    assert answer.fit.held_out_rmse_after == pytest.approx(expected.fit.held_out_rmse_after, rel=1e-4)
