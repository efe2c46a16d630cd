"""The terrain network: an ONNX model with a card (`calibration.models.card`), run for six wheels in one batch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from regolithd.calibration.models.card import ModelCard, ModelCardError, read_card
from regolithd.calibration.models.onnx_session import ModelError, open_session
from regolithd.daemon.pipeline.snapshot import WHEELS, Array, Mask

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import onnxruntime

REMEDY = "Train one (`regolithd train`), or correct [estimator] model."


class TerrainModelError(ModelError):
    """A file holds an ONNX model that is not a terrain network, or does not fit the daemon."""


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """The network's estimate for six wheels: NaN where an input was missing. `outside` has shape (inputs, 6)."""

    cohesion_Pa: Array
    friction_angle_rad: Array
    outside: Mask


class TerrainNetwork:
    """A terrain network, ready to run; `input_names` are in the order of its inputs."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._session = open_session(path, REMEDY)
        self.card = _card(path, self._session)
        self.input_names = tuple(variable.name for variable in self.card.inputs)
        self._low = np.array([[variable.low] for variable in self.card.inputs])
        self._high = np.array([[variable.high] for variable in self.card.inputs])
        self._name = self._session.get_inputs()[0].name
        self._run_once()

    def estimate(self, inputs: Mapping[str, Array]) -> Terrain:
        """Return the soil estimate under six wheels; `inputs` has an array of shape (6,) for each of `input_names`."""
        batch = np.array([inputs[name] for name in self.input_names])
        missing = np.isnan(batch)
        answer = self._run(np.where(missing, 0.0, batch))
        cohesion, tangent = np.where(missing.any(axis=0), np.nan, answer)
        with np.errstate(invalid="ignore"):
            outside = (batch < self._low) | (batch > self._high)
        return Terrain(cohesion, np.arctan(tangent), outside)

    def _run(self, inputs: Array) -> Array:
        batch = np.ascontiguousarray(inputs.T, dtype=np.float32)
        (answer,) = self._session.run(None, {self._name: batch})
        return np.asarray(answer, np.float64).T

    def _run_once(self) -> None:
        """Run it once, so that a model that does not fit is refused at the start."""
        middle = np.repeat((self._low + self._high) / 2, WHEELS, axis=1)
        try:
            answer = self._run(middle)
        except Exception as error:  # onnxruntime's errors have no common class
            raise TerrainModelError(f"{self.path}: does not run on a batch of six: {error}") from error
        if not np.isfinite(answer).all():
            raise TerrainModelError(f"{self.path}: gives no finite numbers in the middle of its own training range")


class AbsentTerrainNetwork:
    """Stands in for a network that cannot be used: every estimate is missing (NaN)."""

    def __init__(self) -> None:
        self.card = ModelCard("none", (), (), gain_Nm_per_A=1.0)
        self.input_names: tuple[str, ...] = ()

    def estimate(self, _inputs: Mapping[str, Array]) -> Terrain:
        """Return no estimate for six wheels."""
        missing = np.full(WHEELS, np.nan)
        return Terrain(missing, missing, np.zeros((0, WHEELS), np.bool_))


def _card(path: Path, session: onnxruntime.InferenceSession) -> ModelCard:
    try:
        card = read_card(session.get_modelmeta().custom_metadata_map)
    except (ModelCardError, UnicodeDecodeError) as error:
        raise TerrainModelError(
            f"{path}: its metadata do not fit: {error}. Train it with `regolithd train`."
        ) from error
    wrong = [
        f"its {what} has shape {tensors[0].shape} and type {tensors[0].type}, expected (N, {len(variables)}) of floats"
        for what, tensors, variables in (
            ("input", session.get_inputs(), card.inputs),
            ("output", session.get_outputs(), card.outputs),
        )
        if len(tensors) != 1 or not _fits(tensors[0], len(variables))
    ]
    if wrong:
        raise TerrainModelError(f"{path}: {'; '.join(wrong)}. Its metadata and its layers disagree: train it anew.")
    return card


def _fits(tensor: onnxruntime.NodeArg, columns: int) -> bool:
    if tensor.type != "tensor(float)" or len(tensor.shape) != 2:
        return False
    rows, width = tensor.shape
    return width == columns and (rows == WHEELS or not isinstance(rows, int))  # a free axis has a name, or None
