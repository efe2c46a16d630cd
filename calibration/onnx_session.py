"""How the rover runs its networks: one thread that does not spin, since one call of six wheels takes microseconds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import onnxruntime

if TYPE_CHECKING:
    from pathlib import Path


def open_session(path: Path) -> onnxruntime.InferenceSession:
    """Return the network of a file, ready to run; raises what onnxruntime raises where it is none."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
