"""Detects a change of soil from half-second means of six wheels, by `calibration.posterior.change_detection`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from regolithd.calibration.parameters import SOILS
from regolithd.calibration.posterior import change_detection as change
from regolithd.calibration.terrain.wheel_soil import contact_angle, wheel_torque

if TYPE_CHECKING:
    from regolithd.daemon.config.configuration import Configuration
    from regolithd.daemon.pipeline.snapshot import Array, SoilChange

REFERENCE = SOILS["sandy-loam"]
"""Soil that gives the shape of torque against load and slip; the detector estimates its magnitude while driving."""


class SoilChangeDetector:
    """The detector for one rover. An alarm resets it: its state belongs to the old soil."""

    def __init__(self, configuration: Configuration) -> None:
        self._wheel = configuration.wheel
        self._threshold = configuration.change.threshold
        self._state = change.start()

    def step(self, time_ns: int, load_N: Array, slip: Array, torque_Nm: Array) -> change.Alarm | None:
        """Take the means of one half second, shape (6,), NaN where a wheel stood still or was not measured."""
        angle = contact_angle(load_N, slip, self._wheel, REFERENCE)
        expected = wheel_torque(angle, slip, self._wheel, REFERENCE)
        self._state, _ = change.step(self._state, torque_Nm, expected)
        alarm = change.alarm(self._state, time_ns, self._threshold)
        if alarm is not None:
            self._state = change.start()
        return alarm


def wheels_of(group: str) -> tuple[int, ...]:
    """Return the numbers (1–6) of the wheels of a group of the detector."""
    members = change.WHEEL_GROUPS[change.GROUP_NAMES.index(group)]
    return tuple(wheel + 1 for wheel, member in enumerate(members) if member)


def soil_change_text(changed: SoilChange) -> str:
    """Return an alarm and its evidence as one sentence."""
    alarm = changed.alarm
    what = "is weaker: wheel torque fell" if alarm.direction == "fall" else "is stronger: wheel torque rose"
    ago_s = (alarm.time_ns - alarm.onset_ns) / 1e9
    wheels = {"all": "all wheels", "front": "the front wheels", "front-and-middle": "the front and middle wheels"}
    probability = ""
    if (fall := changed.fall) is not None:
        probability = (
            f"; probability of a decrease: cohesion {100 * fall.cohesion:.0f} %, "
            f"friction angle {100 * fall.friction_angle:.0f} %, drawbar margin {100 * fall.drawbar_margin:.0f} %"
        )
    return (
        f"the soil {what} to {100 * alarm.torque_ratio:.0f} % of what load and slip predict, since {ago_s:g} s, "
        f"under {wheels.get(alarm.group, alarm.group)} (statistic {alarm.statistic:.1f}, threshold {alarm.threshold:g})"
        f"{probability}"
    )
