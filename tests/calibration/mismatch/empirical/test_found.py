"""What has no name is modelled all the same: from a recording to a curve, into a corrected simulation, and back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import winch
from winch import Winch

from regolithd.calibration.mismatch.comparison import compare
from regolithd.calibration.mismatch.data.recording import Recording, from_columns
from regolithd.calibration.mismatch.simulation.load import load_simulation

if TYPE_CHECKING:
    from regolithd.calibration.mismatch.result import Comparison

ROWS, DRUMS, STEP_S, NOISE_A = 3000, 2, 0.5, 0.2
TIME_S = STEP_S * np.arange(ROWS)


def _hump(speed: np.ndarray) -> np.ndarray:
    return np.asarray(0.4 * np.sign(speed) * np.exp(-(((np.abs(speed) - 0.8) / 0.2) ** 2) / 2))


def _recording(seed: int, size: float = 1.0, faster: float = 1.0) -> Recording:
    """Return a recording of a winch that has a resonance, driven otherwise in each."""
    rng = np.random.default_rng(seed)
    phase = np.stack([TIME_S / rng.uniform(18, 25) + rng.uniform(0, 6) for _ in range(DRUMS)], axis=1)
    speed, pull = faster * (np.sin(phase) + 0.5 * np.sin(2.7 * phase)), 40 + 15 * np.sin(phase / 3)
    current = 0.02 * pull + size * _hump(speed) + rng.normal(0, NOISE_A, speed.shape)
    columns = {"current_A": current, "speed": speed, "pull_N": pull}
    table = {"t_s": np.repeat(TIME_S, DRUMS), "drum": np.tile(np.arange(1.0, DRUMS + 1), ROWS)}
    return from_columns({**table, **{name: values.ravel() for name, values in columns.items()}}, unit="drum")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the winch's SIM.toml."""
    made = tmp_path_factory.mktemp("winch")
    module = Path(winch.__file__).parent
    (made / "SIM.toml").write_text(f'[simulation]\nmodel = "winch:Winch"\npath = "{module}"\n', encoding="utf-8")
    return made


@pytest.fixture(scope="module")
def found(folder: Path) -> Comparison:
    """Return the comparison of a recording with the simulation that knows no resonance, its correction written."""
    made = compare(_recording(1), load_simulation(folder / "SIM.toml"))
    made.write_corrected(folder / "NEW.toml", empirical=True)
    made.write_corrected(folder / "NAMES.toml")
    return made


def test_the_curve_is_the_concealed_one(found: Comparison) -> None:
    """Over the magnitude of the speed, against the motion, inside its band at most knots."""
    (place,) = found.answer.unexplained
    curve = place.curve
    assert curve is not None
    assert (place.covariate, curve.coupling, curve.magnitude, curve.unit) == ("wheel_speed", "drag", True, "A")
    truth = _hump(np.array(curve.at))
    assert np.mean((np.array(curve.low) < truth) & (truth < np.array(curve.high))) > 0.75
    assert np.max(np.abs(np.array(curve.value) - truth)) < 0.1


def test_the_held_out_error_with_the_curve_is_that_of_the_true_model(found: Comparison) -> None:
    """Before it is that of the names alone, after it the noise's to five percent."""
    curve = found.answer.unexplained[0].curve
    assert curve is not None
    assert curve.held_out_rmse_before == pytest.approx(found.answer.fit.held_out_rmse_after, rel=0.01)
    assert curve.held_out_rmse_after == pytest.approx(NOISE_A, rel=0.05)


def test_a_bump_is_suggested_and_no_name_given(found: Comparison) -> None:
    """Among the first three, with its place and width; the verdict stays `unexplained`."""
    assert (found.answer.verdict, found.answer.effects) == ("unexplained", ())
    place = found.answer.unexplained[0]
    assert place.curve is not None
    assert place.suggestions[0].bic_behind == 0
    assert all(each.held_out_rmse < place.curve.held_out_rmse_before for each in place.suggestions)
    bump = next(each for each in place.suggestions if each.form == "bump")
    assert bump.equation.startswith("Δcurrent_A = (c · exp(−((|speed| − a)/k)²/2)")
    assert bump.parameters["a"].value == pytest.approx(0.8, abs=0.05)
    assert bump.parameters["a"].low < 0.8 < bump.parameters["a"].high


def test_another_recording_agrees_with_the_corrected_simulation(found: Comparison, folder: Path) -> None:
    """The file has the curve, labelled, and nothing is left; without `empirical` it has none."""
    assert found.answer.unexplained
    assert "empirical_curves" not in (folder / "NAMES.toml").read_text(encoding="utf-8")
    again = compare(_recording(2), load_simulation(folder / "NEW.toml"))
    assert again.answer.verdict == "consistent"
    assert again.answer.fit.held_out_rmse_before == pytest.approx(NOISE_A, rel=0.05)


def test_a_curve_that_is_gone_is_told(found: Comparison, folder: Path) -> None:
    """As for named effects; and that the recording leaves the curve's range."""
    assert found.answer.unexplained
    again = compare(_recording(3, size=0.0, faster=1.2), load_simulation(folder / "NEW.toml"))
    (change,) = again.answer.changes
    assert (change.name, change.parameter, change.corrected) == ("empirical-drag-over-wheel_speed", "factor", 1.0)
    assert change.statement.startswith("the empirical curve over the speed is gone, on both drums: factor from 1 to ")
    assert change.low <= 0 < change.high
    assert any("outside the range of the empirical curve" in note for note in again.answer.notes)
    again.write_corrected(folder / "GONE.toml", empirical=True)
    (left,) = load_simulation(folder / "GONE.toml").empirical_curves
    assert max(map(abs, left.curve.value)) < 0.1


def test_the_simulation_itself_has_no_curve() -> None:
    """What nobody corrected adds nothing."""
    assert Winch().empirical_curves == ()
