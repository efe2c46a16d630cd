"""Every candidate of the contract is there, tells what it is, and returns columns of its physics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drives import recording, simulation

from calibration.mismatch.candidates import Candidate, library
from calibration.mismatch.scene import Scene, build_scene

CONTRACT = {
    "coulomb-friction": "direction",
    "viscous-friction": "wheel_speed",
    "stribeck-friction": "wheel_speed",
    "cold-lubricant-friction": "temperature",
    "load-dependent-efficiency": "torque",
    "torque-constant-temperature": "temperature",
    "rotor-inertia": "wheel_acceleration",
    "wheel-angle-ripple": "wheel_angle",
    "grade-resistance": "pitch",
    "turning-resistance": "yaw_rate",
    "slip-sinkage": "slip",
    "multi-pass-compaction": "wheel_row",
    "soil-transition": "time",
    "load-cell-drift": "time",
    "current-sensor-bias": "none",
    "bearing-drag": "time",
}


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Return a short drive."""
    return build_scene(recording(length_s=120.0), simulation())


def test_the_library_has_every_name_of_the_contract_with_its_covariate() -> None:
    """The list is a floor."""
    assert {c.name: c.covariate for c in library()}.items() >= CONTRACT.items()


@pytest.mark.parametrize("candidate", library(), ids=lambda c: c.name)
def test_a_candidate_tells_what_it_is_and_has_finite_columns(candidate: Candidate, scene: Scene) -> None:
    """Equation, words, signature, experiment and source; columns of the recording's shape, a coefficient each."""
    for told in (candidate.equation, candidate.words, candidate.signature, candidate.experiment, candidate.source):
        assert len(told) > 5
    shapes = [*candidate.shapes(scene), *candidate.seek(scene, np.where(scene.mask, 0.001, 0.0))]
    assert shapes or not candidate.applies(scene)
    for shape in shapes[:: max(1, len(shapes) // 5)]:
        columns = candidate.columns(scene, shape)
        assert columns.shape[1:] == scene.mask.shape
        assert np.isfinite(columns[:, scene.mask]).all()
        assert candidate.parameters(shape, [1.0] * len(columns))


def test_friction_changes_sign_with_rotation_and_slope_does_not(scene: Scene) -> None:
    """What tells Coulomb friction, a sensor's bias and the slope apart."""
    by_name = {c.name: c for c in library()}
    direction = scene.covariates["direction"]
    drag = by_name["coulomb-friction"].columns(scene, {})[0]
    np.testing.assert_array_equal(drag[scene.mask], direction[scene.mask])
    slope = by_name["grade-resistance"].columns(scene, {"shared": "evenly"})[0]
    np.testing.assert_allclose(slope, np.sin(scene.covariates["pitch"]))


def test_a_temperature_that_no_wheel_changes_is_no_reason_to_call_friction_cold(scene: Scene) -> None:
    """Wheels that differ by a kelvin and stay there say nothing of grease, nor of magnets; one that warms does."""
    steady = np.broadcast_to(np.linspace(0.8, 1.6, 6), scene.mask.shape)
    kept = replace(scene, covariates={**scene.covariates, "temperature": steady})
    by_name = {c.name: c for c in library()}
    cold, magnets = by_name["cold-lubricant-friction"], by_name["torque-constant-temperature"]
    assert all(cold.reluctance(kept, shape) > 5 for shape in cold.shapes(kept))
    assert all(magnets.reluctance(kept, shape) > 5 for shape in magnets.shapes(kept))
    assert any(cold.reluctance(scene, shape) == 0 for shape in cold.shapes(scene))
    assert any(magnets.reluctance(scene, shape) == 0 for shape in magnets.shapes(scene))
    drag = [cold.columns(kept, shape)[0] for shape in cold.shapes(kept) if shape["power"] == 0.0]
    assert min(float(np.min(np.abs(d[kept.mask]))) for d in drag) > 0.5, "no grease loses its drag within a kelvin"
