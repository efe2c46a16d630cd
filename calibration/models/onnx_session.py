"""How the rover opens and runs its networks: one thread that does not spin, since one call of six wheels is quick."""

from __future__ import annotations

from typing import TYPE_CHECKING

import onnxruntime

if TYPE_CHECKING:
    from pathlib import Path


class ModelError(Exception):
    """A network cannot be used; the message says which file, what is wrong with it, and the cure."""


def open_session(path: Path, cure: str) -> onnxruntime.InferenceSession:
    """Return the network of a file, ready to run.

    Raises
    ------
    ModelError
        There is no such file, or it is damaged or no network; the message ends with `cure`.
    """
    if not path.is_file():
        raise ModelError(f"{path}: no such file. {cure}")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors have no common class
        raise ModelError(f"{path}: damaged, or not an ONNX model ({error}). {cure}") from error
