"""The peers: the same two files, a fair library, and answers in the contract's names."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from regolithd.calibration.validation.blind_trials.baselines import (
    PEERS,
    lasso_stability,
    main,
    pose,
    pysindy_aic,
    read_recording,
    stepwise_bic,
)
from regolithd.calibration.validation.blind_trials.concealed import EFFECTS
from regolithd.calibration.validation.blind_trials.files import toml_text, write_trial
from regolithd.calibration.validation.blind_trials.generator import Plan, make_trial

if TYPE_CHECKING:
    from pathlib import Path


def test_the_library_has_every_name(tmp_path: Path) -> None:
    """A peer could name each of the sixteen, and the base parameters' tangents are taken out of every column."""
    trial = make_trial(Plan(1, 2, "nothing", ()), duration_s=240)
    recording, _ = write_trial(trial, tmp_path)
    problem = pose(read_recording(recording), trial.tables)
    assert set(problem.names) == set(EFFECTS)
    assert np.all(np.isfinite(problem.columns))
    assert "[soil]" in toml_text(trial.tables)


@pytest.mark.parametrize("peer", [pysindy_aic, stepwise_bic, lasso_stability], ids=list(PEERS))
def test_each_peer_finds_what_is_plain_to_see(peer: object, tmp_path: Path) -> None:
    """Against white noise, with its exact column in the library, every peer has the truth in its set."""
    trial = make_trial(Plan(1, 2, "nothing", ()), duration_s=240)
    recording, _ = write_trial(trial, tmp_path)
    problem = pose(read_recording(recording), trial.tables)
    noise = np.random.default_rng(1).normal(size=problem.residual.shape)
    column = problem.columns[:, problem.names.index("viscous-friction")]
    plain = type(problem)(column + 0.1 * noise, problem.columns, problem.names, problem.block)
    assert callable(peer)
    assert "viscous-friction" in peer(plain)


def test_the_peers_write_one_answer_each(tmp_path: Path) -> None:
    """As a program, they read a recording and a simulation and write names and seconds."""
    recording, simulation = write_trial(
        make_trial(Plan(1, 2, "single", ("grade-resistance",)), duration_s=240), tmp_path
    )
    main(str(recording), str(simulation), str(tmp_path / "said.json"))
    said = json.loads((tmp_path / "said.json").read_text())
    assert set(said) == set(PEERS)
    assert all(set(answer["names"]) <= set(EFFECTS) for answer in said.values())
