"""The baselines: a library with every name, and answers in the names of the effects."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.validation.blind_trials.baselines import (
    BASELINES,
    lasso_stability,
    lisdd_terms,
    main,
    pysindy_aic,
    read_recording,
    regression_of,
    stepwise_bic,
)
from regolithd.calibration.validation.blind_trials.recordings.files import toml_text, write_trial
from regolithd.calibration.validation.blind_trials.recordings.generator import Plan, make_trial
from regolithd.calibration.validation.blind_trials.recordings.library_effects import LIBRARY_EFFECTS

if TYPE_CHECKING:
    from pathlib import Path


def test_the_library_has_every_name(tmp_path: Path) -> None:
    """The library has a column for each of the sixteen effects, and all its columns are finite."""
    trial = make_trial(Plan(1, 2, "nothing", ()), duration_s=240)
    recording, _ = write_trial(trial, tmp_path)
    regression = regression_of(read_recording(recording), trial.tables)
    assert set(regression.names) == set(LIBRARY_EFFECTS)
    assert np.all(np.isfinite(regression.columns))
    assert "[soil]" in toml_text(trial.tables)


@pytest.mark.parametrize("baseline", [pysindy_aic, stepwise_bic, lasso_stability, lisdd_terms], ids=list(BASELINES))
def test_each_baseline_finds_an_obvious_effect(baseline: object, tmp_path: Path) -> None:
    """With white noise and the effect's exact column in the library, every baseline selects the effect."""
    trial = make_trial(Plan(1, 2, "nothing", ()), duration_s=240)
    recording, _ = write_trial(trial, tmp_path)
    regression = regression_of(read_recording(recording), trial.tables)
    noise = np.random.default_rng(1).normal(size=regression.residual.shape)
    column = regression.columns[:, regression.names.index("viscous-friction")]
    plain = replace(regression, residual=column + 0.1 * noise)
    assert callable(baseline)
    assert "viscous-friction" in baseline(plain)


def test_the_baselines_write_one_answer_each(tmp_path: Path) -> None:
    """As a program they read a recording and a simulation, and write names and seconds."""
    recording, simulation = write_trial(
        make_trial(Plan(1, 2, "single", ("grade-resistance",)), duration_s=240), tmp_path
    )
    main(str(recording), str(simulation), str(tmp_path / "answers.json"))
    answers = json.loads((tmp_path / "answers.json").read_text())
    assert set(answers) == set(BASELINES)
    assert all(set(answer["names"]) <= set(LIBRARY_EFFECTS) for answer in answers.values())
