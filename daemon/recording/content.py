"""Snapshots and estimates as the JSON of an MCAP file; a number that is read back is the same to the last bit.

Each message is flat, so that Foxglove, Lichtblick and PlotJuggler list every value by its name: `load_N_3` is the load
of wheel 3. What was not measured is left out: there is no null.
"""

from __future__ import annotations

import math
from dataclasses import asdict
from functools import cache
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
ESTIMATED = ("wheel_torque_Nm", "smoothed_torque_Nm", "smoothed_load_N", "slip", "cohesion_Pa", "friction_angle_rad")
"""The numbers that are estimated of each wheel."""

_RENAMED = {"belief": "posterior", "outside": "outside_training_range"}
"""Name in a recording of an earlier version → current name."""
_BODY = {quantity.name for quantity in QUANTITIES if not quantity.per_wheel}


@cache
def six(name: str) -> tuple[str, ...]:
    """Return the names of a quantity's values of wheels 1 to 6."""
    return tuple(f"{name}_{wheel}" for wheel in range(1, WHEELS + 1))


def _write(content: dict[str, Any]) -> bytes:
    return to_json(content)  # pydantic's writer: all digits, and five times as fast as the json module


def _measured(name: str, values: list[float]) -> dict[str, float]:
    """Return name of each wheel → value; without those that were not measured (NaN)."""
    if math.isfinite(sum(values)):  # all are: the usual case, in a third of the time
        return dict(zip(six(name), values, strict=True))
    return {key: value for key, value in zip(six(name), values, strict=True) if math.isfinite(value)}


def snapshot_json(snapshot: Snapshot) -> bytes:
    """Return a snapshot as JSON: what was measured of each wheel and of the body."""
    content: dict[str, Any] = {"sequence": snapshot.sequence, "time_ns": snapshot.time_ns}
    for quantity, row in zip(QUANTITIES, snapshot.values.tolist(), strict=True):
        if quantity.per_wheel:
            content |= _measured(quantity.name, row)
        elif math.isfinite(row[0]):
            content[quantity.name] = row[0]
    return _write(content)


def snapshot_from_json(content: dict[str, Any]) -> Snapshot:
    """Return the snapshot that `snapshot_json`, of this version or an earlier one, wrote."""
    content = as_written_today(content)
    names = [six(each.name) if each.per_wheel else (each.name,) * WHEELS for each in QUANTITIES]
    values = np.array([[content.get(name) for name in row] for row in names], dtype=np.float64)
    values.flags.writeable = False
    return Snapshot(content["sequence"], content["time_ns"], values)


def estimate_json(estimate: Estimate) -> bytes:
    """Return an estimate as JSON: what was estimated of each wheel; posterior and alarm where there are any."""
    content: dict[str, Any] = {
        "sequence": estimate.snapshot.sequence,
        "time_ns": estimate.snapshot.time_ns,
        "model_version": estimate.model_version,
        **dict(zip(six("slip_source"), estimate.slip_source, strict=True)),
        **dict(zip(six("valid"), estimate.valid.tolist(), strict=True)),
        **_joined("outside_training_range", estimate.outside_inputs),
    }
    for name in ESTIMATED:
        content |= _measured(name, getattr(estimate, name).tolist())
    if estimate.posterior is not None:
        content["posterior"] = asdict(estimate.posterior)
    if estimate.soil_change is not None:
        content["soil_change"] = _without_null(asdict(estimate.soil_change))
    return _write(content)


def _joined(name: str, texts: list[tuple[str, ...]]) -> dict[str, str]:
    return {key: ", ".join(text) for key, text in zip(six(name), texts, strict=True)}


def _without_null(content: dict[str, Any]) -> dict[str, Any]:
    """Return an object of objects without the fields that have no value."""
    found = {name: _without_null(value) if isinstance(value, dict) else value for name, value in content.items()}
    return {name: value for name, value in found.items() if value is not None}


def as_written_today(content: dict[str, Any]) -> dict[str, Any]:
    """Return a recorded snapshot or estimate as this version writes it, whichever version wrote it.

    Until version 0.2 the values of six wheels were a list, with null where there was none.
    """
    current: dict[str, Any] = {}
    for old_name, value in content.items():
        name = _RENAMED.get(old_name, old_name)
        if not isinstance(value, list):
            current[name] = value
        elif name in _BODY:
            current[name] = value[0]
        elif value and isinstance(value[0], list):
            current |= _joined(name, value)
        else:
            current |= dict(zip(six(name), value, strict=True))
    return _without_null(current)
