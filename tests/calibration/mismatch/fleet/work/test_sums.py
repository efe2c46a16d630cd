"""Sums of products of one recording, compared with sums over its readings."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import fleet_arm
import numpy as np
import pytest
from sample_answer import FINDINGS
from scipy.signal import lfilter

from regolithd.calibration.mismatch import Prior, Simulation
from regolithd.calibration.mismatch.data.recording import as_recording, from_columns
from regolithd.calibration.mismatch.fleet.work import sums as of_recordings
from regolithd.calibration.mismatch.fleet.work.found import Found, FoundTerm
from regolithd.calibration.mismatch.fleet.work.sums import Sums, sums_of
from regolithd.calibration.mismatch.problem.build import build_problem
from regolithd.calibration.mismatch.problem.covariates import direction_of
from regolithd.calibration.mismatch.problem.state.initial_states import initial_states

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

READINGS, MISSING = 600, 17
DEVIATION, AUTOCORRELATION_TIME = np.array([0.15, 0.2]), 1.5
PRIOR_STD = 0.02
LAWS = (
    ("coulomb-friction", {}),
    ("cold-lubricant-friction", {"temperature_scale_K": 10.0}),
    ("bearing-drag", {"onset_s": 0.0, "rise_s": 0.0}),
)


def measured() -> dict[str, Array]:
    """Return half a minute of two joints; one reading of the elbow is missing."""
    columns = fleet_arm.columns(3, coulomb=(0.2, 0.1), viscous=0.05)
    columns["torque_Nm"][MISSING] = np.nan
    return columns


def by_joint(values: Array) -> Array:
    """Return a column as shape (time, joint)."""
    return np.asarray(values.reshape(len(fleet_arm.JOINTS), READINGS).T, np.float64)


def made() -> tuple[Sums, Array, Array]:
    """Return the sums, and the columns and the residual that they are of, shape (…, time, joint)."""
    columns = measured()
    own = np.random.default_rng(1).normal(size=(2, READINGS, 2)).astype(np.float32)
    terms = tuple(FoundTerm("time", False, {}, (0, 1), 3.0, column[None]) for column in own)
    # The recording's own comparison linearised the simulation at another inertia than the stated 0.5.
    found = Found(FINDINGS, {"inertia_kg_m2": 0.53}, DEVIATION, AUTOCORRELATION_TIME, 0.1, 8.0, terms, {})
    recording = as_recording(columns, unit="axis")
    speed, acceleration, torque = (
        by_joint(columns[name]) for name in ("speed_rad_s", "acceleration_rad_s2", "torque_Nm")
    )
    mask = np.isfinite(torque)
    direction = direction_of(speed)
    expected = np.stack([acceleration, direction, direction, *own.astype(np.float64)])
    residual = np.where(mask, torque - 0.5 * acceleration, 0.0)
    return sums_of(recording, fleet_arm.Arm(), "torque_Nm", LAWS, found), np.where(mask, expected, 0.0), residual


@pytest.fixture(scope="module")
def sums() -> tuple[Sums, Array, Array]:
    """Return the sums, and what they are of."""
    return made()


def test_columns_are_parameters_laws_and_what_the_recording_shows_itself(sums: tuple[Sums, Array, Array]) -> None:
    """A law that does not apply (no temperature was recorded) has no column."""
    found, _, _ = sums
    assert (found.wheels, found.tangents) == (("elbow", "wrist"), ("inertia_kg_m2",))
    assert (found.places, found.own) == (((1,), (), (2,)), ((3,), (4,)))
    np.testing.assert_allclose(found.prior_stds, [PRIOR_STD])


def test_sums_are_of_the_readings_that_are_compared(sums: tuple[Sums, Array, Array]) -> None:
    """Products of columns with each other and with the residual of the stated simulation, and fourth powers."""
    found, columns, residual = sums
    np.testing.assert_allclose(found.gram, np.einsum("ctw,dtw->wcd", columns, columns), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.moment, np.einsum("ctw,tw->wc", columns, residual), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found.fourth, np.einsum("ctw->wc", columns**4), rtol=1e-6)
    np.testing.assert_allclose(found.energy, np.sum(residual**2, axis=0), rtol=1e-9)
    assert found.counts.tolist() == [READINGS - 1, READINGS]
    np.testing.assert_allclose(found.weights, 1 / (DEVIATION**2 * AUTOCORRELATION_TIME))


def test_long_recordings_are_summed_in_pieces(sums: tuple[Sums, Array, Array], monkeypatch: pytest.MonkeyPatch) -> None:
    """With the same sums."""
    monkeypatch.setattr(of_recordings, "PIECE", 7)
    again, _, _ = made()
    for name in ("gram", "moment", "fourth"):
        np.testing.assert_allclose(getattr(again, name), getattr(sums[0], name), rtol=1e-9, atol=1e-9)


def test_blocks_hold_what_parameters_and_own_terms_leave(sums: tuple[Sums, Array, Array]) -> None:
    """Their fit is held by the parameters' priors; each block has the weighted moments of its own instants."""
    found, columns, residual = sums
    weights = 1 / (DEVIATION**2 * AUTOCORRELATION_TIME)
    taken = columns[[0, 3, 4]]
    matrix = np.einsum("ctw,dtw,w->cd", taken, taken, weights)
    matrix[0, 0] += 1 / PRIOR_STD**2
    fitted = np.linalg.solve(matrix, np.einsum("ctw,tw,w->c", taken, residual, weights))
    left = (residual - np.einsum("c,ctw->tw", fitted, taken)) * weights
    count = found.blocks.shape[0]
    assert count >= 30
    np.testing.assert_allclose(found.blocks.sum(axis=0), np.einsum("ctw,tw->wc", columns, left), rtol=1e-5, atol=1e-4)
    for block in range(count):
        there = np.arange(READINGS) * count // READINGS == block
        expected = np.einsum("ctw,tw->wc", columns[:, there], left[there])
        np.testing.assert_allclose(found.blocks[block], expected, rtol=1e-5, atol=1e-4)


class Heated(Simulation):
    """A block whose temperature begins with its first reading."""

    channel, unit = "rise_K", "K"
    inputs: ClassVar = ("power_W", "rise_K")
    parameters: ClassVar = {"resistance_K_W": Prior(0.2, 0.01, "K/W")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return a state that forgets 4 % in each step."""
        heated = 0.04 * values["resistance_K_W"] * inputs["power_W"]
        heated[0] = inputs["rise_K"][0]
        return np.asarray(lfilter([1.0], [1.0, -0.96], heated, axis=0), np.float64)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return the power."""
        return {"power": inputs["power_W"]}


def test_an_initial_state_is_each_recording_s_own() -> None:
    """Products are those of noise to which the doubt of a first reading adds: generalised least squares."""
    random = np.random.default_rng(5)
    power = np.repeat(random.uniform(50, 250, 10), 30)
    rise = Heated().predict({"power_W": power[:, None], "rise_K": np.full((300, 1), 12.0)}, {"resistance_K_W": 0.2})
    table = {"t_s": np.arange(300.0), "power_W": power, "rise_K": rise[:, 0] + random.normal(0, 0.3, 300)}
    recording, deviation = from_columns(table), np.array([0.3])
    found = Found(FINDINGS, {}, deviation, 1.0, 0.1, 8.0, (), {})
    sums, problem = sums_of(recording, Heated(), "rise_K", (), found), build_problem(recording, Heated())
    (state,) = initial_states(problem)
    slope = problem.tangent("resistance_K_W")[:, 0]
    covariance = deviation**2 * np.eye(300) + np.outer(state.column, state.column)
    weighted = deviation**2 * np.linalg.solve(covariance, slope)
    assert sums.gram[0, 0, 0] == pytest.approx(weighted @ slope)
    assert sums.moment[0, 0] == pytest.approx(weighted @ problem.residual[:, 0])
    assert sums.gram[0, 0, 0] < 0.99 * (slope @ slope)
