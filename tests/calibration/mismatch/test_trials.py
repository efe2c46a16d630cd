"""The two sample trials come back as their truth says."""

from __future__ import annotations

import json
import tomllib
from typing import TYPE_CHECKING

import pytest
from jsonschema import Draft202012Validator

from regolithd.calibration.mismatch.answer import answer_schema
from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.data.recording import read_recording
from regolithd.calibration.mismatch.simulation.load import load_simulation

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize("name", ["nothing", "bearing-drag"])
def test_trial_is_answered_as_its_truth(shared_folder: Path, name: str) -> None:
    """Exact names, exact wheels, onset within a tenth of the length."""
    trials = shared_folder / "trials"
    truth = json.loads((trials / f"{name}.truth.json").read_text())["effects"]
    simulation = load_simulation(tomllib.loads((trials / f"{name}.toml").read_text()))
    answer = compare(read_recording(trials / f"{name}.csv.gz"), simulation).answer
    assert answer.verdict == ("missing-physics" if truth else "consistent")
    assert [(e.name, list(e.wheels)) for e in answer.effects] == [(t["name"], t["wheels"]) for t in truth]
    for effect, true in zip(answer.effects, truth, strict=True):
        assert effect.onset_s == pytest.approx(true["time_s"], abs=180)
    plain = json.loads(json.dumps(answer.to_json(), allow_nan=False))
    assert not list(Draft202012Validator(answer_schema()).iter_errors(plain))
