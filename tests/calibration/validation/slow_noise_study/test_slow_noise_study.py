"""The study of slow noise: its recordings, and what it counts."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.validation.slow_noise_study import __main__ as study
from regolithd.calibration.validation.slow_noise_study.axis import EFFECTS, NOISE, RATE_HZ, SIZE, recording

if TYPE_CHECKING:
    from pathlib import Path


def torque(correlation_s: float, effect: str = "") -> np.ndarray:
    """Return the torque of the first recording of a kind."""
    return recording(0, correlation_s, effect).channels["torque_Nm"][:, 0]


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_has_its_size(effect: str) -> None:
    """In mean readings; the noise and the parameters are those of the recording without it."""
    sound, acting = torque(2.0), torque(2.0, effect)
    assert np.sqrt(np.mean((acting - sound) ** 2)) == pytest.approx(SIZE * np.abs(sound).mean(), rel=0.1)


def test_half_of_the_noise_wanders() -> None:
    """Over a correlation time half of the variance is still there, times 1/e."""
    still = recording(3, 5.0)
    speed = still.channels["speed_rad_s"][:, 0]
    resting = still.channels["torque_Nm"][speed == 0, 0]
    size = np.std(resting)
    assert size == pytest.approx(NOISE * np.abs(still.channels["torque_Nm"]).mean(), rel=0.25)
    assert np.std(np.diff(resting)) == pytest.approx(np.sqrt(2 - np.exp(-1 / RATE_HZ / 5.0)) * size, rel=0.1)


def test_the_command_counts_what_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """By verdict and by names."""
    told = {"": "consistent", "cold lubricant": "cold-lubricant-friction", "slow wave": "unexplained"}
    monkeypatch.setattr(study, "told_of", lambda _, __, effect="": told.get(effect, "viscous-friction"))
    monkeypatch.setattr(sys, "argv", ["study", str(tmp_path / "new" / "figures.json"), "--count", "3"])
    study.main()
    figures = json.loads((tmp_path / "new" / "figures.json").read_text())
    assert figures["nothing_10_s_consistent"] == figures["cold_lubricant_right"] == figures["slow_wave_right"] == 3
    assert figures["Coulomb_friction_right"] == 0
    assert "Coulomb friction, noise correlated over 2 s: 0 right (3 viscous-friction)" in capsys.readouterr().out


def test_what_is_told_of_a_recording() -> None:
    """Nothing is there, and the noise is quick against the recording."""
    assert study.told_of(1, 0.5) == "consistent"
