"""The paper's network as an estimator: the shipped ONNX model, loaded once."""

from __future__ import annotations

import functools

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from regolithd.calibration.models import TERRAIN_MODEL

Array = NDArray[np.float64]


@functools.cache
def _session() -> onnxruntime.InferenceSession:
    return onnxruntime.InferenceSession(TERRAIN_MODEL)


def estimate(load_N: Array, slip: Array, current_A: Array) -> NDArray[np.float32]:
    """Return cohesion [Pa] and tan φ [1], shape (…, 2), for load [N], slip [1] and current [A] of one shape."""
    inputs = np.stack([load_N, slip, current_A], axis=-1)
    (raw,) = _session().run(None, {"inputs": inputs.reshape(-1, 3).astype(np.float32)})
    estimates: NDArray[np.float32] = raw.reshape(*inputs.shape[:-1], 2)
    return estimates
