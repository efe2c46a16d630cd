"""The messages of one SYNC: `snapshot` (all wheels, as lists of six) and `wheel/…` (one wheel, as plain values).

Their measured fields follow from the device registry.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, create_model

from regolithd.daemon.messages.header import Header, WheelNumber
from regolithd.daemon.pipeline.snapshot import BODY_QUANTITIES, WHEEL_QUANTITIES, SlipSource

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Quantity


@dataclass(frozen=True, slots=True)
class _WheelField:
    """A field of `wheel`, which is a list of six in `snapshot`."""

    name: str
    type: Any
    description: str = ""


def _number(quantity: Quantity) -> Any:  # noqa: ANN401  # a type
    return int | None if quantity.flags else float | None


_WHEEL_FIELDS = (
    _WheelField("measured", bool, "Where current, speed and load all arrived."),
    _WheelField("valid", bool, "Where an estimate could be made."),
    *(_WheelField(each.name, _number(each), each.description) for each in WHEEL_QUANTITIES),
    _WheelField("wheel_torque_Nm", float | None, "At the wheel, by Eq. 11, before smoothing."),
    _WheelField("smoothed_torque_Nm", float | None, "After the filter that removes momentary current drops."),
    _WheelField("smoothed_load_N", float | None),
    _WheelField("slip", float | None, "i = 1 − V/(r ω)."),
    _WheelField(
        "slip_source", SlipSource, "Measured, the configured constant, or none because the wheel stands still."
    ),
    _WheelField("cohesion_Pa", float | None),
    _WheelField("friction_angle_rad", float | None),
    _WheelField(
        "outside_training_range",
        tuple[str, ...],
        "The terrain network's inputs that lie outside its training range; the estimate of such a wheel is unreliable.",
    ),
)


def _described(kind: Any, description: str) -> tuple[Any, Any]:  # noqa: ANN401  # a type, and pydantic's field
    return kind, Field(description=description or None)


def _six(kind: Any) -> Any:  # noqa: ANN401  # a type
    return Annotated[tuple[kind, ...], Field(min_length=6, max_length=6)]


SnapshotMessage: type[Header] = create_model(  # type: ignore[call-overload]
    "SnapshotMessage",
    __base__=Header,
    __module__=__name__,
    __doc__="All measurements of one SYNC, of the six wheels and the body, and the estimates made from them.",
    model_version=_described(str, "Version of the terrain network."),
    **{each.name: _described(_number(each), each.description) for each in BODY_QUANTITIES},
    **{each.name: _described(_six(each.type), each.description) for each in _WHEEL_FIELDS},
)

WheelMessage: type[Header] = create_model(  # type: ignore[call-overload]
    "WheelMessage",
    __base__=Header,
    __module__=__name__,
    __doc__="The measurements and estimates of one wheel at one SYNC: the values that `snapshot` has as lists of six.",
    model_version=(str, ...),
    wheel=(WheelNumber, ...),
    **{each.name: (each.type, ...) for each in _WHEEL_FIELDS},
)
