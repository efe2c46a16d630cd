"""A structure without a name is told with its true time and its true share of the residual."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from linear_machine import STEP_S as LINEAR_STEP_S
from linear_machine import equations_of, problem_of, table
from winch import Winch

from regolithd.calibration.mismatch import compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.inference.unexplained.located import largest_stretch, spell_of
from regolithd.calibration.mismatch.regression.group import Term
from regolithd.calibration.mismatch.regression.groups.smooth_groups import with_smooth_terms
from regolithd.calibration.mismatch.regression.likelihood.as_read import as_read

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROWS, DRUMS, STEP_S = 2000, 3, 1.0
TIME_S = STEP_S * np.arange(ROWS)
PHASE = np.stack([TIME_S / 20 + drum for drum in range(DRUMS)], axis=1)
SPEED, PULL = np.sin(PHASE) + 0.5 * np.sin(2.7 * PHASE), 40 + 15 * np.sin(PHASE / 3)


def recorded(seed: int, effect: Array, drums: list[int]) -> tuple[Recording, float]:
    """Return a recording with an effect under autocorrelated noise, and the effect's share on those drums."""
    fresh = np.random.default_rng(seed).normal(0, 0.2, (ROWS + 5, DRUMS))
    noise = sum(fresh[k : k + ROWS] for k in range(6)) / np.sqrt(6)
    current = 0.02 * PULL + effect + noise
    columns = {"current_A": current, "speed": SPEED, "pull_N": PULL}
    table = {"t_s": np.repeat(TIME_S, DRUMS), "drum": np.tile(np.arange(1.0, DRUMS + 1), ROWS)}
    share = np.sum(effect[:, drums] ** 2) / np.sum((effect + noise)[:, drums] ** 2)
    return from_columns({**table, **{name: values.ravel() for name, values in columns.items()}}, unit="drum"), share


@pytest.mark.parametrize(("seed", "first_s", "last_s", "size"), [(1, 473, 1020, 0.4), (2, 1210, 1500, 0.6)])
def test_a_spell_is_located_to_a_tenth_of_its_length(seed: int, first_s: float, last_s: float, size: float) -> None:
    """Drum 1 drags for a while: both ends, and the share of its residual to a tenth."""
    during = (first_s < TIME_S) & (last_s > TIME_S)
    effect = size * np.sign(SPEED) * during[:, None] * np.array([1.0, 0.0, 0.0])
    recording, share = recorded(seed, effect, [0])
    (found,) = compare(recording, Winch()).answer.unexplained
    assert (found.covariate, found.wheels) == ("time", (1,))
    assert found.from_s == pytest.approx(first_s, abs=0.1 * (last_s - first_s))
    assert found.to_s == pytest.approx(last_s, abs=0.1 * (last_s - first_s))
    assert found.share_of_residual == pytest.approx(share, abs=0.1)


@pytest.mark.parametrize("size", [0.3, 1.0])
def test_what_lasts_is_located_from_end_to_end(size: float) -> None:
    """A hump over speed on all drums, small and large: all of the time, and its share to a tenth."""
    recording, share = recorded(5, size * np.exp(-(((SPEED - 0.6) / 0.15) ** 2)), [0, 1, 2])
    (found,) = compare(recording, Winch()).answer.unexplained
    assert (found.covariate, found.wheels) == ("wheel_speed", (1, 2, 3))
    assert found.from_s < 0.1 * TIME_S[-1]
    assert found.to_s > 0.9 * TIME_S[-1]
    assert found.share_of_residual == pytest.approx(share, abs=0.1)


def test_a_spell_that_acts_by_a_factor_is_located_between_the_knots() -> None:
    """A gain over time, with blank readings: its ends are found to some instants, knots are a hundred apart."""
    columns = table()
    during = (columns["t_s"] > 130) & (columns["t_s"] < 275)
    columns["reading_V"] = columns["reading_V"] * (1 + 0.4 * during)
    columns["reading_V"][::7] = np.nan
    equations = equations_of(problem_of(columns))
    equations = equations.over(with_smooth_terms(equations.design))
    (group,) = (each for each in equations.design.groups if (each.name, each.coupling) == ("time", "gain"))
    term = Term(group, (0, 1))
    read = as_read(equations, equations.fit([term]))
    assert spell_of(equations, read, term) == pytest.approx((130.0, 275.0), abs=4 * LINEAR_STEP_S)


@pytest.mark.parametrize(
    ("values", "stretch"),
    [([1.0, -5.0, 2.0, -1.0, 3.0, -9.0], (2, 4)), ([-1.0, -2.0], (0, 0)), ([1.0, 1.0], (0, 1)), ([-3.0, 1.0], (1, 1))],
)
def test_the_largest_stretch_has_the_largest_sum(values: list[float], stretch: tuple[int, int]) -> None:
    """Losses within it are taken along, those at its ends are not."""
    assert largest_stretch(np.array(values)) == stretch
