"""Encodes an estimate as JSON: the `snapshot` message and the six `wheel/…` messages of one SYNC.

The fields are put together here and written by pydantic's JSON writer, without the models' validation, which would take
ten times as long. A test compares the result with the models' own, byte by byte.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from pydantic_core import to_json

from regolithd.daemon.messages.header import SCHEMA_VERSION, time_fields
from regolithd.daemon.pipeline.snapshot import BODY_QUANTITIES, ROW, WHEEL_QUANTITIES, WHEELS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.daemon.pipeline.snapshot import Array, Estimate

_START = re.compile(rb'(\{"schema_version":\d+,"late":)(false|true),')


def write(fields: dict[str, Any]) -> bytes:
    """Return a message's fields as JSON; NaN becomes null."""
    return to_json(fields, inf_nan_mode="null")


def as_late(payload: bytes) -> bytes:
    """Return the same message marked as late. Its schema version stays: the store may hold messages of an older one.

    A payload that does not begin as these messages do, as another version may have stored it, is returned as it is.
    """
    start = _START.match(payload)
    if start is None:
        return payload
    return start[1] + b"true," + payload[start.end() :]


def _integers(numbers: Array) -> list[int | None]:
    return [int(number) if number == number else None for number in numbers.tolist()]  # noqa: PLR0124  # NaN differs


def _per_wheel(estimate: Estimate) -> dict[str, Sequence[Any]]:
    """Return the fields that have one value for each wheel, name → six values."""
    snapshot = estimate.snapshot
    return {
        "measured": snapshot.valid.tolist(),
        "valid": estimate.valid.tolist(),
        **{
            quantity.name: _integers(snapshot[quantity]) if quantity.flags else snapshot[quantity].tolist()
            for quantity in WHEEL_QUANTITIES
        },
        "wheel_torque_Nm": estimate.wheel_torque_Nm.tolist(),
        "smoothed_torque_Nm": estimate.smoothed_torque_Nm.tolist(),
        "smoothed_load_N": estimate.smoothed_load_N.tolist(),
        "slip": estimate.slip.tolist(),
        "slip_source": [source.value for source in estimate.slip_source],
        "cohesion_Pa": estimate.cohesion_Pa.tolist(),
        "friction_angle_rad": estimate.friction_angle_rad.tolist(),
        "outside_training_range": estimate.outside_inputs,
    }


def _header(estimate: Estimate, session: str) -> dict[str, Any]:
    return {
        "schema_version": SCHEMA_VERSION,
        "late": False,
        "session": session,
        "sequence": estimate.snapshot.sequence,
        **time_fields(estimate.snapshot.time_ns),
        "model_version": estimate.model_version,
    }


def encode(estimate: Estimate, session: str, *, with_wheels: bool = True) -> tuple[bytes, list[bytes]]:
    """Return the `snapshot` message of an estimate, and its six `wheel/…` messages, wheel 1 first, or none."""
    header = _header(estimate, session)
    six = _per_wheel(estimate)
    body = {quantity.name: float(estimate.snapshot.values[ROW[quantity], 0]) for quantity in BODY_QUANTITIES}
    wheels = [
        write(header | {"wheel": wheel + 1} | {name: values[wheel] for name, values in six.items()})
        for wheel in range(WHEELS if with_wheels else 0)
    ]
    return write(header | body | six), wheels
