"""Two-axis inclinometer (CiA 410) with a yaw-rate gyroscope: the body's attitude, in steps of 0.01°."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from regolithd.drivers.devices.device import Device, Measured, PdoLayout, Quantity, Setting
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.virtual.device import VirtualDevice

if TYPE_CHECKING:
    from regolithd.drivers.devices.virtual.measurement import Measurement

RESOLUTION, SLOPE_LONG, SLOPE_LATERAL = 0x6000, 0x6010, 0x6020
YAW_RATE_OBJECT = 0x2010  # manufacturer-specific: CiA 410 has no rate

_RAD_PER_CENTIDEGREE = math.radians(0.01)

PITCH = Quantity("pitch_rad", "Positive nose up.", per_wheel=False)
ROLL = Quantity("roll_rad", "Positive right side down.", per_wheel=False)
YAW_RATE = Quantity("yaw_rate_rad_s", "Positive to the left.", per_wheel=False)


class VirtualInclinometer(VirtualDevice):
    """A virtual inclinometer."""

    def measure(self, measurement: Measurement) -> None:
        """Put the slopes into 0x6010 and 0x6020 (in the configured resolution), the yaw rate into 0x2010."""
        step_deg = self.dictionary.get(RESOLUTION) / 1000
        self.dictionary.put(SLOPE_LONG, 0, round(math.degrees(measurement.pitch_rad) / step_deg))
        self.dictionary.put(SLOPE_LATERAL, 0, round(math.degrees(measurement.roll_rad) / step_deg))
        self.dictionary.put(YAW_RATE_OBJECT, 0, round(math.degrees(measurement.yaw_rate_rad_s) * 100))


INCLINOMETER = Device(
    kind="inclinometer",
    configuration_key="inclinometer",
    eds=EDS_FOLDER / "inclinometer.eds",
    default_node_id=21,
    tpdos=(
        PdoLayout(
            1,
            (
                Measured(SLOPE_LONG, 0, PITCH, _RAD_PER_CENTIDEGREE),
                Measured(SLOPE_LATERAL, 0, ROLL, _RAD_PER_CENTIDEGREE),
                Measured(YAW_RATE_OBJECT, 0, YAW_RATE, _RAD_PER_CENTIDEGREE),
            ),
        ),
    ),
    settings=(Setting(RESOLUTION, 0, 10),),  # 0.01°
    virtual=VirtualInclinometer,
)
