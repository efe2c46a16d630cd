"""Snapshots and estimates as the JSON that an MCAP file holds; a number read back is the same to the last bit."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from daemon.snapshot import QUANTITIES, WHEELS, Snapshot

if TYPE_CHECKING:
    from daemon.snapshot import Array, Estimate

SNAPSHOT = "snapshot"
ESTIMATE = "estimate"
EVENT = "event"


def _numbers(array: Array) -> list[float | None]:
    return [None if value != value else value for value in array.tolist()]  # noqa: PLR0124  # the quickest NaN test


def snapshot_json(snapshot: Snapshot) -> bytes:
    """Return a snapshot as JSON: each quantity that any node measured, as six numbers or null."""
    rows = snapshot.values
    measured: list[bool] = np.logical_not(np.isnan(rows).all(axis=1)).tolist()
    content: dict[str, Any] = {"sequence": snapshot.sequence, "time_ns": snapshot.time_ns}
    for row, quantity in enumerate(QUANTITIES):
        if measured[row]:
            content[quantity] = _numbers(rows[row])
    return json.dumps(content, separators=(",", ":")).encode()


def snapshot_from_json(content: dict[str, Any]) -> Snapshot:
    """Return the snapshot that `snapshot_json` wrote."""
    nothing = [None] * WHEELS
    values = np.array([content.get(quantity, nothing) for quantity in QUANTITIES], dtype=np.float64)
    values.flags.writeable = False
    return Snapshot(content["sequence"], content["time_ns"], values)


def estimate_json(estimate: Estimate) -> bytes:
    """Return what the stages made of a snapshot as JSON, six numbers or null for each name."""
    content = {
        "sequence": estimate.snapshot.sequence,
        "time_ns": estimate.snapshot.time_ns,
        "wheel_torque_Nm": _numbers(estimate.wheel_torque_Nm),
        "smoothed_torque_Nm": _numbers(estimate.smoothed_torque_Nm),
        "smoothed_load_N": _numbers(estimate.smoothed_load_N),
        "slip": _numbers(estimate.slip),
        "slip_source": estimate.slip_source,
        "cohesion_Pa": _numbers(estimate.cohesion_Pa),
        "friction_angle_rad": _numbers(estimate.friction_angle_rad),
        "valid": estimate.valid.tolist(),
        "outside": [estimate.outside_inputs(wheel) for wheel in range(WHEELS)],
        "model_version": estimate.model_version,
    }
    return json.dumps(content, separators=(",", ":")).encode()
