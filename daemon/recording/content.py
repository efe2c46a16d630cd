"""Snapshots and estimates as the JSON of an MCAP file; a number that is read back is the same to the last bit."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic_core import to_json

from regolithd.daemon.pipeline.snapshot import WHEELS, Snapshot
from regolithd.drivers.devices.registry import QUANTITIES

if TYPE_CHECKING:
    from regolithd.daemon.pipeline.snapshot import Estimate

SNAPSHOT = "snapshot"
ESTIMATE = "estimate"
EVENT = "event"

_RENAMED = {"belief": "posterior"}
"""Fields of an estimate that were renamed: name in recordings of version 0.1, current name."""


def _write(content: dict[str, Any]) -> bytes:
    return to_json(
        content, inf_nan_mode="null"
    )  # pydantic's writer: all digits, and five times as fast as the json module


def snapshot_json(snapshot: Snapshot) -> bytes:
    """Return a snapshot as JSON: each quantity that any node measured, as six numbers or null."""
    rows = snapshot.values
    measured: list[bool] = np.logical_not(np.isnan(rows).all(axis=1)).tolist()
    content: dict[str, Any] = {"sequence": snapshot.sequence, "time_ns": snapshot.time_ns}
    for row, quantity in enumerate(QUANTITIES):
        if measured[row]:
            content[quantity.name] = rows[row].tolist()
    return _write(content)


def snapshot_from_json(content: dict[str, Any]) -> Snapshot:
    """Return the snapshot that `snapshot_json` wrote."""
    nothing = [None] * WHEELS
    values = np.array([content.get(quantity.name, nothing) for quantity in QUANTITIES], dtype=np.float64)
    values.flags.writeable = False
    return Snapshot(content["sequence"], content["time_ns"], values)


def estimate_json(estimate: Estimate) -> bytes:
    """Return an estimate as JSON: for each name six values, null where there is none."""
    content: dict[str, Any] = {
        "sequence": estimate.snapshot.sequence,
        "time_ns": estimate.snapshot.time_ns,
        "wheel_torque_Nm": estimate.wheel_torque_Nm.tolist(),
        "smoothed_torque_Nm": estimate.smoothed_torque_Nm.tolist(),
        "smoothed_load_N": estimate.smoothed_load_N.tolist(),
        "slip": estimate.slip.tolist(),
        "slip_source": estimate.slip_source,
        "cohesion_Pa": estimate.cohesion_Pa.tolist(),
        "friction_angle_rad": estimate.friction_angle_rad.tolist(),
        "valid": estimate.valid.tolist(),
        "outside": [estimate.outside_inputs(wheel) for wheel in range(WHEELS)],
        "model_version": estimate.model_version,
    }
    if estimate.posterior is not None:
        content["posterior"] = asdict(estimate.posterior)
    if estimate.soil_change is not None:
        content["soil_change"] = asdict(estimate.soil_change)
    return _write(content)


def with_current_names(content: dict[str, Any]) -> dict[str, Any]:
    """Return a recorded snapshot or estimate with the field names of this version, whichever version wrote it."""
    return {_RENAMED.get(name, name): value for name, value in content.items()}
