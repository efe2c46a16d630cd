"""Model card of a terrain network, in its ONNX metadata: version, inputs, outputs, gain.

Four keys in the model's `metadata_props`:

- `regolithd.version`: text, different for each training.
- `regolithd.inputs`, `regolithd.outputs`: JSON, a list of `{"name", "unit", "low", "high"}` in the order of the
  columns. `low` and `high` are the range of the training set; inputs outside it are listed in the published messages.
- `regolithd.gain_Nm_per_A`: number, the drivetrain's gain (Eq. 11) that the training set was made with. A network with
  the input `motor_current_A` is given the torque divided by this gain, so that it works with other gears.

The model has one input of shape (N, inputs) and one output of shape (N, outputs), float32, N free. Scaling is inside
the model: it takes and returns the units that it names.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

INPUTS = {
    "load_N": "N",
    "slip": "1",
    "motor_current_A": "A",
    "wheel_torque_Nm": "N.m",
    "wheel_speed_rad_s": "rad/s",
}
"""Inputs that the daemon can provide, with their units."""

OUTPUTS = {"cohesion_Pa": "Pa", "tan_friction_angle": "1"}
"""Outputs that a network must have, in this order, with their units."""


class ModelCardError(ValueError):
    """The metadata are not a valid model card; `problems` lists everything that is wrong."""

    def __init__(self, problems: list[str]) -> None:
        super().__init__("; ".join(problems))
        self.problems = problems


@dataclass(frozen=True, slots=True)
class Variable:
    """One column of the input or output; [low, high] is its range in the training set."""

    name: str
    unit: str
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class ModelCard:
    """Version, inputs, outputs and gain of a terrain network."""

    version: str
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    gain_Nm_per_A: float

    def metadata(self) -> dict[str, str]:
        """Return the entries for `metadata_props`."""
        return {
            "regolithd.version": self.version,
            "regolithd.inputs": json.dumps([asdict(variable) for variable in self.inputs]),
            "regolithd.outputs": json.dumps([asdict(variable) for variable in self.outputs]),
            "regolithd.gain_Nm_per_A": repr(self.gain_Nm_per_A),
        }


def read_card(metadata: Mapping[str, str]) -> ModelCard:
    """Return the card in the metadata; raise `ModelCardError` with everything that is wrong."""
    problems: list[str] = []
    inputs = _variables(metadata, "regolithd.inputs", INPUTS, problems)
    outputs = _variables(metadata, "regolithd.outputs", OUTPUTS, problems)
    if outputs and tuple(v.name for v in outputs) != tuple(OUTPUTS):
        problems.append(f"regolithd.outputs must be {', '.join(OUTPUTS)}, in this order")
    version = metadata.get("regolithd.version", "")
    if not version:
        problems.append("regolithd.version is missing")
    try:
        gain = float(metadata.get("regolithd.gain_Nm_per_A", ""))
    except ValueError:
        gain = 0.0
    if not 0 < gain < float("inf"):
        problems.append("regolithd.gain_Nm_per_A is missing or not a positive number")
    if problems:
        raise ModelCardError(problems)
    return ModelCard(version, inputs, outputs, gain)


def _variables(
    metadata: Mapping[str, str], key: str, known: Mapping[str, str], problems: list[str]
) -> tuple[Variable, ...]:
    try:
        entries = json.loads(metadata.get(key, ""))
        variables = tuple(Variable(str(e["name"]), str(e["unit"]), float(e["low"]), float(e["high"])) for e in entries)
    except (ValueError, TypeError, KeyError):
        problems.append(f'{key} is missing or not a JSON list of {{"name", "unit", "low", "high"}}')
        return ()
    if not variables:
        problems.append(f"{key} is empty")
    for variable in variables:
        if variable.name not in known:
            problems.append(f"{key}: {variable.name!r} is unknown; known are {', '.join(known)}")
        elif variable.unit != known[variable.name]:
            problems.append(f"{key}: {variable.name} is in {variable.unit!r}, expected {known[variable.name]!r}")
        if not variable.low < variable.high:
            problems.append(f"{key}: {variable.name} has low {variable.low} not below high {variable.high}")
    return variables
