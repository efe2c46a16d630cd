"""An effect that was identified on one recording is the same law on any other."""

from __future__ import annotations

import tomllib
from functools import cache
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pytest

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch.candidates.library import library
from regolithd.calibration.mismatch.changes import corrected_problem, stated_in
from regolithd.calibration.mismatch.contribution import Contribution
from regolithd.calibration.mismatch.corrected import corrected_tables, stated_effects
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.errors import SimulationError
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.toml_document import to_toml

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class Cart(Simulation):
    """Motor current of a cart with a motor on each side."""

    channel, unit, wheel_column = "current_A", "A", "side"
    inputs = ("force_N", "speed")
    parameters: ClassVar = {"gain_A_N": Prior(0.02, 0.0002, "A/N")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the current that the pull needs."""
        return values["gain_A_N"] * inputs["force_N"] * np.sign(inputs["speed"])

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return speed, turns and time."""
        return {"wheel_speed": inputs["speed"], "yaw_rate": inputs["yaw_rate_rad_s"], "time": inputs["t_s"]}

    def side(self, wheels: Sequence[int | str]) -> Array:
        """Left, then right."""
        return np.array([-1.0 if wheel == 1 else 1.0 for wheel in wheels])


def scrub(drive: dict[str, Array]) -> Array:
    """Return a drag that saturates with the rate of the turn."""
    rate = np.abs(drive["yaw_rate_rad_s"])
    return 0.5 * rate / (rate + 0.3) * np.sign(drive["speed"])


def losses(drive: dict[str, Array]) -> Array:
    """Return a loss that grows with the square of the pull."""
    return 2e-4 * drive["force_N"] * np.abs(drive["force_N"]) * np.sign(drive["speed"])


CONCEALED = {"turning-resistance": scrub, "load-dependent-efficiency": losses}


def driven(seed: int, pull_N: float, turn_rad_s: float) -> dict[str, Array]:
    """Return three minutes to and fro, with pulls and turns up to a size."""
    generator = np.random.default_rng(seed)
    time_s = np.repeat(0.05 * np.arange(3600), 2)
    stage = np.floor(time_s / 4).astype(int)
    turns = turn_rad_s * generator.uniform(-1, 1, 50) * (generator.uniform(size=50) < 0.6)
    return {
        "t_s": time_s,
        "side": np.tile([1.0, 2.0], 3600),
        "speed": np.where(stage % 3 == 0, -1.0, 1.0) * (1 + 0.5 * np.sin(time_s / 3)),
        "yaw_rate_rad_s": turns[stage],
        "force_N": pull_N * (0.6 + 0.4 * np.sin(time_s / 5)),
    }


def recorded(drive: dict[str, Array], effect: Array, seed: int = 0) -> Recording:
    """Return the drive with the current of the pull and of an effect, under noise."""
    current = 0.02 * drive["force_N"] * np.sign(drive["speed"]) + effect
    noise = np.random.default_rng(seed).normal(0, 0.05, len(current))
    return from_columns({**drive, "current_A": current + noise}, unit="side")


@cache
def corrected_by(name: str) -> tuple[Contribution, ...]:
    """Return the effects in the file that is written after a drive of middling pulls and turns."""
    first = driven(1, 40.0, 0.6)
    found = compare(recorded(first, CONCEALED[name](first)), Cart())
    assert [effect.name for effect in found.answer.effects] == [name]
    evidence = found.evidence
    tables = corrected_tables({}, Cart(), evidence.values, evidence.contributions, found.answer.effects)
    return stated_effects(tomllib.loads(to_toml(tables)))


@pytest.mark.parametrize("name", sorted(CONCEALED))
@pytest.mark.parametrize(("pull_N", "turn_rad_s"), [(25.0, 0.25), (60.0, 1.5)])
def test_a_corrected_file_gives_the_true_effect_on_another_range(name: str, pull_N: float, turn_rad_s: float) -> None:
    """Identified at middling pulls and turns, the effect is right to a tenth at lesser and at larger ones."""
    drive = driven(2, pull_N, turn_rad_s)
    true = CONCEALED[name](drive)
    posed = build_problem(recorded(drive, true, 1), Cart())
    added = corrected_problem(posed, stated_in(library(), corrected_by(name), ())).added
    assert float(np.std(added - true.reshape(-1, 2))) < 0.1 * float(np.std(true))


def test_an_effect_that_does_not_act_in_a_later_recording_is_zero_there() -> None:
    """A drive without a turn has a yaw rate that never varies: the scrub of turns is there, and 0."""
    straight = driven(3, 40.0, 0.0)
    shape = {"half_at": 1.0, "ends": 0.0, "by": "rate", "reference_turn": 0.3}
    scrubbing = Contribution("turning-resistance", shape, (0.3, 0.0), (1, 2), 0.1)
    answer = compare(recorded(straight, np.zeros(7200)), Cart(), effects=[scrubbing]).answer
    assert answer.verdict == "consistent"


def test_a_corrected_effect_whose_covariate_was_not_recorded_is_one_message() -> None:
    """It names the effect, and the covariate that is lacking."""
    drag = Contribution("cold-lubricant-friction", {"power": 0.0}, (0.3,), (1, 2), 0.1)
    drive = driven(4, 40.0, 0.5)
    with pytest.raises(SimulationError, match="cold-lubricant-friction depends on temperature"):
        compare(recorded(drive, np.zeros(7200)), Cart(), effects=[drag])


def test_a_corrected_effect_without_its_scale_is_one_message() -> None:
    """A file that an earlier version wrote lacks what the law is scaled by."""
    loss = Contribution("load-dependent-efficiency", {"power": 1.0}, (0.3,), (1, 2), 0.1)
    drive = driven(5, 40.0, 0.5)
    with pytest.raises(SimulationError, match="its shape lacks 'reference_size'; find the effect again"):
        compare(recorded(drive, np.zeros(7200)), Cart(), effects=[loss])
