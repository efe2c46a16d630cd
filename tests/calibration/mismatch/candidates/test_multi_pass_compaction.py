"""A rut in the user's own simulation of a rover: by what its parameters are called, the soil is known."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from regolithd.calibration.mismatch import Prior, Simulation, compare, from_columns
from regolithd.calibration.mismatch.candidates.multi_pass_compaction import MultiPassCompaction
from regolithd.calibration.mismatch.problem.build import build_problem

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from regolithd.calibration.mismatch.data.recording import Recording

Array = NDArray[np.float64]
COUNT, WHEELS = 2000, 4
RUT = {"k_phi_kN": 1.5, "cohesion_Pa": 1.25, "shear_modulus_m": 0.8}


class Cart(Simulation):
    """The torque of four wheels on soil: resistance by sinkage, and traction that builds up with slip."""

    channel, unit, wheel_column = "torque_Nm", "N·m", "wheel"
    inputs = ("slip", "load_N")
    parameters: ClassVar = {
        "k_phi_kN": Prior(800.0, 40.0, "kN"),
        "cohesion_Pa": Prior(900.0, 60.0, "Pa"),
        "shear_modulus_m": Prior(0.02, 0.001, "m"),
    }

    def row(self, wheels: Sequence[int | str]) -> Array:
        """Return the first two wheels in front."""
        return np.array([0 if float(wheel) <= 2 else 1 for wheel in wheels])

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the torque."""
        return torque(inputs["slip"], inputs["load_N"], values)

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return slip and load."""
        return {"slip": inputs["slip"], "load": inputs["load_N"]}


def torque(slip: Array, load_N: Array, soil: Mapping[str, float | Array]) -> Array:
    """Return resistance, less on stiff soil, and traction with the shear displacement of a contact of 10 cm."""
    resistance = 0.02 * load_N * np.sqrt(800.0 / soil["k_phi_kN"])
    mobilised = 1 - np.exp(-0.1 * np.abs(slip) / soil["shear_modulus_m"])
    return resistance + np.sign(slip) * mobilised * (0.01 * soil["cohesion_Pa"] + 0.1 * load_N)


def driven(seed: int, rut: Mapping[str, float]) -> Recording:
    """Return a drive with slip both ways, in which the rear wheels run on soil that differs by these factors."""
    random = np.random.default_rng(seed)
    slip = np.repeat(random.uniform(-0.15, 0.4, COUNT // 10), 10)[:, None] + 0.02 * random.normal(size=(COUNT, WHEELS))
    load = 300 + 40 * np.sin(np.arange(COUNT)[:, None] / np.array([60.0, 70.0, 80.0, 90.0]))
    stated = {name: prior.value for name, prior in Cart.parameters.items()}
    factor = np.array([0.0, 0.0, 1.0, 1.0])
    soil = {name: value * (1 + factor * (rut.get(name, 1.0) - 1)) for name, value in stated.items()}
    read = torque(slip, load, soil) + 2.0 * random.normal(size=slip.shape)
    columns = {
        "t_s": np.repeat(0.5 * np.arange(COUNT), WHEELS),
        "wheel": np.tile(np.arange(1.0, WHEELS + 1), COUNT),
        "slip": slip.ravel(),
        "load_N": load.ravel(),
        "torque_Nm": read.ravel(),
    }
    return from_columns(columns)


def test_a_rut_changes_the_soil_by_the_names_of_its_parameters() -> None:
    """Columns are the derivatives with respect to each, on the rear wheels."""
    problem, rut = build_problem(driven(1, {}), Cart()), MultiPassCompaction()
    assert {shape["by"] for shape in rut.shapes(problem)} == {"current", "stiffness", "soil"}
    found = rut.columns(problem, {"kept": 0.5, "leads": "front", "by": "soil"})
    for column, name in zip(found, ("k_phi_kN", "shear_modulus_m", "cohesion_Pa"), strict=True):
        expected = problem.values[name] * problem.tangent(name) * [0, 0, 1, 1]
        np.testing.assert_allclose(column, expected)


def test_without_such_parameters_the_current_alone_changes() -> None:
    """A simulation whose soil has other names has the form along the prediction."""

    class Otherwise(Cart):
        """The same with a stiffness of its own name."""

        parameters: ClassVar = {
            "stiffness_kN": Prior(800.0, 40.0, "kN"),
            "cohesion_Pa": Prior(900.0, 60.0, "Pa"),
            "shear_modulus_m": Prior(0.02, 0.001, "m"),
        }

        def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
            """Return the torque."""
            return torque(inputs["slip"], inputs["load_N"], {**values, "k_phi_kN": values["stiffness_kN"]})

    problem = build_problem(driven(1, {}), Otherwise())
    assert {shape["by"] for shape in MultiPassCompaction().shapes(problem)} == {"current"}


def test_a_rut_that_changes_its_sign_with_slip_is_named() -> None:
    """Less resistance and more traction: no share of the prediction has that course."""
    found = compare(driven(2, RUT), Cart()).answer
    assert [effect.name for effect in found.effects] == ["multi-pass-compaction"]
    assert found.effects[0].shape["by"] in {"soil", "stiffness"}
    assert compare(driven(3, {}), Cart()).answer.verdict == "consistent"
