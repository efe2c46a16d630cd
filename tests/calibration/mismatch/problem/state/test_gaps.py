"""A state is not known after a gap of the recording for as long as it depends on what the inputs were there."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.state.gaps import after_gaps, inputs_otherwise_in_gaps

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROWS, FORGETS_S = 3000, 60.0
GAPS = (slice(700, 900), slice(1800, 1950))
REASON = "the prediction depends on what the inputs were in a gap of the recording"


class Static(Simulation):
    """A temperature above the room's in proportion to the power."""

    channel, unit = "rise_K", "K"
    inputs = ("power_W",)
    parameters: ClassVar = {"resistance_K_W": Prior(0.2, 0.01, "K/W")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return what the power leads to at last."""
        return values["resistance_K_W"] * inputs["power_W"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the power."""
        return {"power": inputs["power_W"]}


class Block(Static):
    """A heated block, which integrates from one row to the next with the power of the first, or of the second."""

    first_row = -1

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the state of first order."""
        steady, t_s, run = super().predict(inputs, values), inputs["t_s"], inputs["run"]
        found = np.array(steady)
        for row in range(1, len(found)):
            if run[row, 0] == run[row - 1, 0]:
                kept = np.exp(-(t_s[row] - t_s[row - 1]) / FORGETS_S)
                goal = steady[row + self.first_row]
                found[row] = goal + (found[row - 1] - goal) * kept
        return found


class Implicit(Block):
    """The same with the power of the second row."""

    first_row = 0


def recorded(simulation: Simulation, seed: int, *, gaps: bool = True) -> Recording:
    """Return a recording of a power that is held for 40 to 150 s, without the rows of the gaps."""
    random, t_s = np.random.default_rng(seed), np.arange(ROWS, dtype=np.float64)
    power = np.concatenate([np.full(rows, random.uniform(50, 250)) for rows in random.integers(40, 150, size=75)])[
        :ROWS
    ]
    inputs = {"power_W": power[:, None], "t_s": t_s[:, None], "run": np.zeros((ROWS, 1))}
    rise = simulation.predict(inputs, {"resistance_K_W": 0.203})[:, 0]
    kept = np.ones(ROWS, np.bool_)
    for gap in GAPS if gaps else ():
        kept[gap] = False
    columns = {"t_s": t_s, "power_W": power, "rise_K": rise + random.normal(0, 0.3, ROWS)}
    return from_columns({name: values[kept] for name, values in columns.items()})


@pytest.mark.parametrize("simulation", [Block, Implicit])
def test_what_a_state_carries_over_a_gap_is_not_compared_until_it_is_forgotten(simulation: type[Block]) -> None:
    """A few time constants after each gap, with a reason; what remains is consistent."""
    recording = recorded(simulation(), 5)
    problem = build_problem(recording, simulation())
    (left,) = problem.left_out
    assert left.reason == REASON
    assert 2 * 2 * FORGETS_S < left.readings < 2 * 9 * FORGETS_S
    time_s = recording.time_s[~problem.mask[:, 0]]
    assert all(any(gap.stop <= each < gap.stop + 9 * FORGETS_S for gap in GAPS) for each in time_s)
    assert compare(recording, simulation()).answer.verdict == "consistent"


def test_nothing_is_left_out_without_a_state_or_without_a_gap() -> None:
    """A prediction of an instant does not depend on what was before."""
    assert build_problem(recorded(Static(), 6), Static()).left_out == ()
    assert build_problem(recorded(Block(), 6, gaps=False), Block()).left_out == ()
    assert inputs_otherwise_in_gaps(recorded(Block(), 6, gaps=False), Block.inputs) is None


def test_inputs_in_a_gap_differ_by_what_they_do_elsewhere_and_stay_within_their_range() -> None:
    """Beside the gaps alone; a pause between two runs is none."""
    recording = recorded(Block(), 7)
    power = recording.channels["power_W"][:, 0]
    other = inputs_otherwise_in_gaps(recording, Block.inputs)
    assert other is not None
    changed = other.channels["power_W"][:, 0]
    beside = np.flatnonzero(np.diff(recording.time_s) > 1.5)
    np.testing.assert_array_equal(np.flatnonzero(changed != power), np.sort(np.concatenate((beside, beside + 1))))
    assert changed.min() >= power.min()
    assert changed.max() <= power.max()
    assert np.all(np.abs(changed - power)[beside] > 20.0)
    after = after_gaps(recording)
    assert not after[: beside[0] + 2].any()
    assert after[beside[0] + 2 : beside[1]].all()
    apart = from_columns(
        {
            "t_s": recording.time_s,
            "run": np.searchsorted(beside, np.arange(len(power))),
            "power_W": power,
            "rise_K": recording.channels["rise_K"][:, 0],
        }
    )
    assert inputs_otherwise_in_gaps(apart, Block.inputs) is None
