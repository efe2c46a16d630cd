"""Opens an ONNX model with onnxruntime: one thread without spinning, since one call takes less than a millisecond."""

from __future__ import annotations

from typing import TYPE_CHECKING

import onnxruntime

from regolithd.calibration.models.digest import is_damaged

if TYPE_CHECKING:
    from pathlib import Path


class ModelError(Exception):
    """A model cannot be used; the message has the file, the problem, and the remedy."""


def open_session(path: Path, remedy: str) -> onnxruntime.InferenceSession:
    """Return an onnxruntime session of a model file.

    Raises
    ------
    ModelError
        The file cannot be read, is damaged, or is not an ONNX model; the message ends with `remedy`.
    """
    if not path.is_file():
        raise ModelError(f"{path}: no such file. {remedy}")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ModelError(f"{path}: cannot be read: {error.strerror}. {remedy}") from error
    if is_damaged(content):
        raise ModelError(f"{path}: damaged, or changed by another program: its digest does not match. {remedy}")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"], enable_fallback=False)
    except Exception as error:  # onnxruntime's errors have no common base class
        raise ModelError(f"{path}: damaged, or not an ONNX model ({error}). {remedy}") from error
