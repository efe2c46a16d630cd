"""The scale on which a relative error is the same at each reading."""

from __future__ import annotations

import numpy as np
import pytest

from regolithd.calibration.mismatch.data.recording import from_columns
from regolithd.calibration.mismatch.problem.inputs.errors_in_variables import expected_inputs
from regolithd.calibration.mismatch.problem.inputs.reading_scale import ReadingScale
from regolithd.calibration.mismatch.problem.prior import SensorError

READINGS = np.concatenate((np.linspace(-900.0, 900.0, 500), [np.nan]))


@pytest.mark.parametrize("error", [SensorError(relative=0.02), SensorError(0.02, 3.0), SensorError(absolute=3.0)])
def test_the_error_is_the_same_everywhere(error: SensorError) -> None:
    """A reading that is one of its errors further is one deviation further on the scale, and the way back is exact."""
    scale = ReadingScale.of(READINGS, error)
    step = 1e-3
    further = scale.stabilised(READINGS + step * scale.error(READINGS)) - scale.stabilised(READINGS)
    np.testing.assert_allclose(further[:-1], step * scale.deviation, rtol=1e-4)
    np.testing.assert_allclose(scale.readings(scale.stabilised(READINGS)), READINGS, rtol=1e-9, atol=1e-9)


def test_the_error_of_a_reading_has_both_parts() -> None:
    """At 600, 2 % is 12, and with a constant of 5 the error is 13; a relative one alone is not 0 at 0."""
    assert ReadingScale.of(READINGS, SensorError(0.02, 5.0)).error(np.array([600.0]))[0] == pytest.approx(13.0)
    assert ReadingScale.of(READINGS, SensorError(0.02)).error(np.array([0.0]))[0] == pytest.approx(0.1 * 9.0, rel=0.01)
    assert ReadingScale.of(np.zeros(3), SensorError(0.02)).deviation == 0.0


def test_levels_are_found_though_their_errors_differ() -> None:
    """Of loads from 220 to 900 kg that stay for a while, read to 1 %, a tenth of the error is left."""
    # With one error for all levels none fits what is stated: nothing was smoothed, and all of the error was left.
    random = np.random.default_rng(3)
    load_kg = np.repeat(random.choice([220.0, 400.0, 650.0, 900.0], 40), 50)
    read = load_kg * (1 + 0.01 * random.standard_normal(len(load_kg)))
    recording = from_columns({"t_s": np.arange(len(read)) * 0.1, "load_kg": read})
    found = expected_inputs(recording, {"load_kg": SensorError(relative=0.01)}).channels["load_kg"][:, 0]
    assert np.std((found - load_kg) / load_kg) < 0.15 * np.std((read - load_kg) / load_kg)
