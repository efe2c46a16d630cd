"""A bus voltage that sags under the motors' own current is no explanation of that current."""

from __future__ import annotations

import numpy as np

from regolithd.calibration.mismatch.simulation.open_circuit_voltage import open_circuit_voltage


def _currents(rng: np.random.Generator) -> np.ndarray:
    return 0.03 + 0.01 * rng.standard_normal((2000, 6))


def test_a_sag_is_taken_out() -> None:
    """What is left of a supply with a resistance is its slow open-circuit voltage."""
    rng = np.random.default_rng(1)
    current = _currents(rng)
    open_circuit = 25 - 0.5 * np.linspace(0, 1, 2000)[:, None] * np.ones(6)
    measured = open_circuit - 1.5 * np.abs(current).sum(axis=1, keepdims=True) + 0.002 * rng.standard_normal((2000, 1))
    left = open_circuit_voltage(measured, current)
    total = np.abs(current).sum(axis=1)
    assert abs(np.corrcoef(np.diff(measured[:, 0]), np.diff(total))[0, 1]) > 0.9
    assert abs(np.corrcoef(np.diff(left[:, 0]), np.diff(total))[0, 1]) < 0.1
    assert np.max(np.abs(left - open_circuit)) < 0.02


def test_a_voltage_of_its_own_stays_as_it_was() -> None:
    """No sag shows where voltage and current have nothing to do with each other, or the one drives the other."""
    rng = np.random.default_rng(2)
    current = _currents(rng)
    voltage = (25 + 0.4 * np.sin(np.arange(2000) / 60))[:, None] * np.ones(6)
    assert np.array_equal(open_circuit_voltage(voltage, current), voltage)
    driven = current - 0.005 * (voltage - 25)
    assert np.array_equal(open_circuit_voltage(voltage, driven), voltage)


def test_gaps_and_short_recordings_are_no_trouble() -> None:
    """Blank readings stay blank; too few instants say nothing of a resistance."""
    rng = np.random.default_rng(3)
    current = _currents(rng)
    measured = 25 - 1.5 * np.abs(current).sum(axis=1, keepdims=True) * np.ones(6)
    measured[100:200] = np.nan
    current[500:520, 2] = np.nan
    left = open_circuit_voltage(measured, current)
    assert np.isnan(left[100:200]).all()
    assert np.isfinite(left[200:]).all()
    assert np.array_equal(open_circuit_voltage(measured[:20], current[:20]), measured[:20])
