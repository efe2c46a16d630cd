"""The JSON Schema of the answer: real answers of every kind follow it, and it has the keys of the data classes."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from regolithd.calibration.mismatch import Prior, Simulation, compare
from regolithd.calibration.mismatch import answer as answers
from regolithd.calibration.mismatch.answer import Answer, answer_schema
from regolithd.calibration.mismatch.corrected import corrected_tables, stated_effects
from regolithd.calibration.mismatch.data.recording import as_recording
from regolithd.calibration.mismatch.problem.corrections.empirical_curve import EmpiricalCurve
from regolithd.calibration.mismatch.problem.problem import LeftOut

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from regolithd.calibration.mismatch import Candidate
    from regolithd.calibration.mismatch.result import Comparison

    Array = NDArray[np.float64]

PARTS = {
    "effect": answers.Effect,
    "parameter": answers.Parameter,
    "unexplained": answers.Unexplained,
    "range": answers.Range,
    "indistinguishable": answers.Indistinguishable,
    "sensitivity": answers.Sensitivity,
    "fit": answers.FitImprovement,
    "calibrated_parameter": answers.CalibratedParameter,
    "change": answers.Change,
    "left_out": LeftOut,
    "other_answer": answers.OtherAnswer,
    "suggestion": answers.Suggestion,
    "empirical_curve": EmpiricalCurve,
}
"""Data class of each part of the schema."""
FEW = {"coulomb-friction", "viscous-friction", "cold-lubricant-friction"}


class Arm(Simulation):
    """Two joints whose torque is inertia × acceleration."""

    channel, unit = "torque_Nm", "N·m"
    wheel_column = "axis"
    inputs = ("acceleration_rad_s2",)
    parameters: ClassVar = {"inertia_kg_m2": Prior(0.5, 0.02, "kg·m²")}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Array:
        """Return the torque."""
        return values["inertia_kg_m2"] * inputs["acceleration_rad_s2"]

    def covariates(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """Return what friction follows."""
        return {"wheel_speed": inputs["speed_rad_s"]}

    def candidates(self, library: Sequence[Candidate]) -> Sequence[Candidate]:
        """Return friction alone, to be quick."""
        return [candidate for candidate in library if candidate.name in FEW]


class TwoChannels(Arm):
    """The same joints, of which torque and current are measured."""

    channels: ClassVar = {"torque_Nm": "N·m", "current_A": "A"}

    def predict(self, inputs: Mapping[str, Array], values: Mapping[str, float]) -> Any:
        """Return both."""
        torque = super().predict(inputs, values)
        return {"torque_Nm": torque, "current_A": 2 * torque}


def columns(friction: float, wave: float = 0.0) -> dict[str, NDArray[Any]]:
    """Return two joints with Coulomb friction, and a wave of the torque that nothing explains."""
    rng, time_s = np.random.default_rng(1), 0.05 * np.arange(600)
    made: dict[str, list[NDArray[Any]]] = {}
    for axis in ("elbow", "wrist"):
        speed = np.sin(0.7 * time_s) + 0.6 * np.sin(1.9 * time_s)
        acceleration = np.gradient(speed, time_s)
        torque = 0.5 * acceleration + friction * np.sign(speed) + wave * np.sin(time_s / 3)
        rows = {
            "t_s": time_s,
            "axis": np.full(len(time_s), axis),
            "speed_rad_s": speed,
            "acceleration_rad_s2": acceleration,
            "torque_Nm": torque + rng.normal(0, 0.05, len(time_s)),
            "current_A": 2 * torque + rng.normal(0, 0.1, len(time_s)),
        }
        for name, values in rows.items():
            made.setdefault(name, []).append(values)
    return {name: np.concatenate(values) for name, values in made.items()}


def against(simulation: Simulation, friction: float, wave: float = 0.0, **options: Any) -> Comparison:
    """Return a comparison with the two joints."""
    return compare(as_recording(columns(friction, wave), unit="axis"), simulation, **options)


@cache
def real_answers() -> dict[str, Answer]:
    """Return an answer of each kind, of one channel and of two, and of a corrected simulation."""
    found = {
        "consistent": against(Arm(), 0.0).answer,
        "missing": against(Arm(), 0.1).answer,
        "unexplained": against(Arm(), 0.0, 0.2).answer,
        "two channels": against(TwoChannels(), 0.1).answer,
    }
    corrected = against(Arm(), 0.1)
    tables = corrected_tables({}, Arm(), corrected.evidence.values, corrected.evidence.contributions)
    stated = [replace(effect, relative_std=0.05) for effect in stated_effects(tables)]
    return found | {"changed": against(Arm(), 0.2, effects=stated).answer}


def wrong_in(plain: Mapping[str, Any]) -> list[str]:
    """Return what the schema finds wrong."""
    return [f"{error.json_path}: {error.message}" for error in Draft202012Validator(answer_schema()).iter_errors(plain)]


@pytest.mark.parametrize("kind", ["consistent", "missing", "unexplained", "two channels", "changed"])
def test_a_real_answer_follows_the_schema(kind: str) -> None:
    """Every key is there, with its type."""
    assert wrong_in(real_answers()[kind].to_json()) == []


def test_the_real_answers_have_all_parts() -> None:
    """Together they have each verdict, and an entry of each part that a comparison of this size can give."""
    found = real_answers()
    assert {answer.verdict for answer in found.values()} == {"consistent", "missing-physics", "unexplained"}
    for name in ("effects", "unexplained", "sensitivity", "parameters", "changes", "notes"):
        assert any(getattr(answer, name) for answer in found.values()), name
    assert [fit.channel for fit in found["two channels"].fits] == ["torque_Nm", "current_A"]
    assert {each.channel for each in found["two channels"].sensitivity} == {"torque_Nm", "current_A"}


@pytest.mark.parametrize("name", PARTS)
def test_a_part_of_the_schema_has_the_keys_of_its_data_class(name: str) -> None:
    """The keys are the fields, in their order, all required, and each has a meaning."""
    part = answer_schema()["$defs"][name]
    expected = [field.name for field in fields(PARTS[name]) if field.metadata.get("told", True)]
    assert list(part["properties"]) == part["required"] == expected
    assert all(value.get("description") for value in part["properties"].values())


def test_the_schema_has_the_keys_of_the_answer() -> None:
    """Each key of the JSON object, and no other, is described."""
    schema = answer_schema()
    assert list(schema["properties"]) == schema["required"] == list(real_answers()["consistent"].to_json())
    assert {field.name for field in fields(Answer)} == set(schema["properties"])


@pytest.mark.parametrize("key", list(answer_schema()["properties"]))
def test_an_answer_without_a_key_does_not_follow_the_schema(key: str) -> None:
    """The schema notices what is missing."""
    plain = real_answers()["missing"].to_json()
    del plain[key]
    assert len(wrong_in(plain)) == 1
