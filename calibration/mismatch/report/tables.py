"""Tables of the report about the whole answer: parameters, changes, readings left out, errors of channels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from regolithd.calibration.mismatch.changes import direction_of
from regolithd.calibration.mismatch.inference.statements import capital
from regolithd.calibration.mismatch.report.axes import interval, number
from regolithd.calibration.mismatch.report.labels import UNITS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from regolithd.calibration.mismatch.answer import Answer, Change
    from regolithd.calibration.mismatch.report.labels import Labels


@dataclass(frozen=True)
class CalibratedRow:
    """A parameter of the simulation: what was stated, and where the recording moved it."""

    name: str
    stated: str
    value: str
    low: str
    high: str
    unit: str
    beyond_prior: bool


@dataclass(frozen=True)
class ChangeRow:
    """What became of a corrected effect."""

    label: str
    where: str
    direction: str
    parameter: str
    corrected: str
    now: str
    low: str
    high: str
    unit: str


@dataclass(frozen=True)
class LeftOutRow:
    """Readings that are not compared."""

    channel: str
    readings: str
    reason: str


@dataclass(frozen=True)
class ChannelRow:
    """Held-out errors of one of several channels."""

    channel: str
    before: str
    after: str
    floor: str
    unit: str


def calibrated(answer: Answer) -> tuple[CalibratedRow, ...]:
    """Return the simulation's parameters."""
    rows = []
    for one in answer.parameters:
        stated = (
            f"{number(one.prior)} ± {number(one.prior_std, 2)}" if one.prior_std else f"{number(one.prior)} (exact)"
        )
        told = interval(one.value, one.low, one.high) if one.prior_std else (number(one.value, 4), "", "")
        rows.append(CalibratedRow(one.name, stated, *told, UNITS.get(one.unit, one.unit), one.beyond_prior()))
    return tuple(rows)


def changes(answer: Answer, labels: Labels, wheels: Sequence[int | str] = ()) -> tuple[ChangeRow, ...]:
    """Return what differs from the effects that a corrected simulation brought; `wheels` are all of the recording."""
    return tuple(_change(one, labels, wheels, several=len(answer.fits) > 1) for one in answer.changes)


def _change(one: Change, labels: Labels, wheels: Sequence[int | str], *, several: bool) -> ChangeRow:
    """Return one change; of several channels it names its own."""
    factor, unit = labels.scaled(one.unit)
    now, low, high = interval(factor * one.now, factor * one.low, factor * one.high)
    return ChangeRow(
        label=capital(labels.effect(one.name)),
        where=", ".join(filter(None, [one.channel if several else "", labels.wheels(one.wheels, wheels)])),
        direction=direction_of(one),
        parameter=labels.parameter(one.name, one.parameter),
        corrected=number(factor * one.corrected),
        now=now,
        low=low,
        high=high,
        unit=unit,
    )


def left_out(answer: Answer) -> tuple[LeftOutRow, ...]:
    """Return what is not compared, and why."""
    return tuple(LeftOutRow(one.channel, f"{one.readings:,}", one.reason) for one in answer.left_out)


def channels(answer: Answer, units: dict[str, str]) -> tuple[ChannelRow, ...]:
    """Return the errors of each channel, where there are several; `units` by channel."""
    return tuple(
        ChannelRow(
            fit.channel,
            number(fit.held_out_rmse_before),
            number(fit.held_out_rmse_after),
            number(fit.noise_floor_rmse),
            UNITS.get(units.get(fit.channel, ""), units.get(fit.channel, "")),
        )
        for fit in answer.fits
    )
