"""`regolithd train-posterior`, from the command to the ONNX file that the daemon loads."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from regolithd.calibration.posterior.estimator import PosteriorEstimator
from regolithd.calibration.validation.estimators.errors_and_coverage import Case, estimate_all


@pytest.mark.timeout(600)
def test_a_brief_training_already_beats_the_prior(tmp_path: Path) -> None:
    """After 600 steps on 10 000 rovers the posterior mean's error is below 0.9 of the prior's."""
    out = tmp_path / "posterior.onnx"
    command = [
        sys.executable,
        "-m",
        "regolithd",
        "train-posterior",
        "--rovers",
        "10000",
        "--steps",
        "600",
        "--out",
        str(out),
    ]
    subprocess.run(command, check=True, cwd=Path(__file__).parents[2])
    found = estimate_all(1000, Case(), 5, PosteriorEstimator(out))
    error = np.sqrt(np.mean((found.methods["posterior"][:, 0] - found.truth[:, 0]) ** 2))
    assert error < 0.9 * found.truth[:, 0].std()
