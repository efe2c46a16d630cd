"""Motor controller (CiA 402) in profile velocity mode, with the objects of an EPOS 24/1.

Speeds are in rpm at the motor, currents in mA, as the device keeps them.
"""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import TYPE_CHECKING

from regolithd.drivers.canopen.sdo_abort import Abort, AbortError
from regolithd.drivers.devices.device import (
    EVENT_DRIVEN,
    Commanded,
    Device,
    Measured,
    PdoLayout,
    Quantity,
    Setting,
)
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.units import RAD_S_PER_RPM
from regolithd.drivers.devices.virtual.device import VirtualDevice
from regolithd.drivers.devices.virtual.power_state import HALT, STAYS_IN_QUICK_STOP, PowerState, next_state

if TYPE_CHECKING:
    from collections.abc import Mapping

    from regolithd.drivers.devices.virtual.device import ErrorReports, Key, ObjectValues, Place
    from regolithd.drivers.devices.virtual.measurement import Measurement

ABORT_CONNECTION_OPTION, ERROR_CODE, CONTROLWORD, STATUSWORD_OBJECT = 0x6007, 0x603F, 0x6040, 0x6041
QUICK_STOP_OPTION, DISABLE_OPTION, FAULT_REACTION_OPTION = 0x605A, 0x605C, 0x605E
MODE, MODE_DISPLAY, VELOCITY_DEMAND, VELOCITY_ACTUAL, TARGET_VELOCITY = 0x6060, 0x6061, 0x606B, 0x606C, 0x60FF
CURRENT, VOLTAGE, TEMPERATURE = 0x6078, 0x6079, 0x2F00
CURRENT_AVERAGED, VELOCITY_AVERAGED = 0x2027, 0x2028
MAX_VELOCITY, ACCELERATION, DECELERATION, QUICK_STOP_DECELERATION = 0x607F, 0x6083, 0x6084, 0x6085

PROFILE_VELOCITY = 3  # modes of operation, 0x6060

MOTOR_CURRENT = Quantity("motor_current_A", "At the motor, signed.", mirrored=True, noisy=True)
MOTOR_SPEED = Quantity("motor_speed_rad_s", "At the motor, before the gears, signed.", mirrored=True)
MOTOR_TEMPERATURE = Quantity("motor_temperature_degC")
BUS_VOLTAGE = Quantity("bus_voltage_V", "Supply voltage at the motor controller.")
STATUSWORD = Quantity("statusword", "Object 0x6041 of the motor controller.", flags=True)

# EPOS firmware specification, chapter "Error codes".
_EPOS_ERRORS = MappingProxyType(
    {
        0x2310: "overcurrent: short circuit, or the current controller is badly tuned",
        0x3210: "overvoltage: supply too high, or energy fed back while braking",
        0x3220: "undervoltage: supply too weak for the acceleration",
        0x4210: "overtemperature of the power stage",
        0x5113: "internal 5 V supply too low",
        0x6100: "internal software error",
        0x6320: "software parameter out of range",
        0x7320: "position sensor error: encoder cable or supply",
        0x8111: "CAN overrun",
        0x81FD: "CAN bus-off",
        0x81FE: "CAN receive queue overrun",
        0x81FF: "CAN transmit queue overrun",
        0x8611: "following error: the motor cannot follow its demand",
        0xFF01: "Hall sensor error",
        0xFF02: "encoder index not found",
        0xFF03: "encoder resolution wrong",
        0xFF04: "Hall sensor not found",
        0xFF06: "negative limit switch",
        0xFF07: "positive limit switch",
        0xFF08: "Hall angle detection error",
        0xFF09: "software position limit",
        0xFF0A: "position sensor breach",
        0xFF0B: "system overloaded",
    }
)

_QUICK_STOP_RAMP = 2  # of 0x605A and 0x605E
_NO_LIMIT = 1 << 31
COASTING_RPM_PER_S = 50_000.0
"""Deceleration of a motor without current: the friction of its gears (1400 : 1) stops it almost at once."""
AVERAGING_S = 0.05  # time constant of 0x2027 and 0x2028

_VOLTAGE_ENABLED, _REMOTE, _TARGET_REACHED, _SPEED_ZERO = 0x0010, 0x0200, 0x0400, 0x1000
_POWERED = frozenset(
    {
        PowerState.SWITCHED_ON,
        PowerState.OPERATION_ENABLED,
        PowerState.QUICK_STOP_ACTIVE,
        PowerState.FAULT_REACTION_ACTIVE,
    }
)
HEARTBEAT_LOST = 0x8130


class VirtualMotorController(VirtualDevice):
    """A virtual drive: state machine, velocity ramp and measurements."""

    latches_errors = True  # until fault reset

    def __init__(
        self,
        dictionary: ObjectValues,
        errors: ErrorReports,
        wheel: int | None,
        places: Mapping[str, Place] = MappingProxyType({}),
    ) -> None:
        super().__init__(dictionary, errors, wheel, places)
        self.state = PowerState.NOT_READY_TO_SWITCH_ON
        self.speed_rpm = 0.0
        self._controlword = 0
        self._stop_rpm_per_s = COASTING_RPM_PER_S
        self._since_measured_s = 0.0
        self._averages = [0.0, 0.0]
        self.reset()

    @property
    def speed_rad_s(self) -> float:
        """The motor's speed [rad/s]."""
        return self.speed_rpm * RAD_S_PER_RPM

    @property
    def busy(self) -> bool:
        """Whether it moves, or is about to."""
        return bool(self.speed_rpm) or self.state in {PowerState.OPERATION_ENABLED, PowerState.FAULT_REACTION_ACTIVE}

    def reset(self) -> None:
        """Start anew: transitions 0 and 1 are made at once."""
        self.state = PowerState.SWITCH_ON_DISABLED
        self.speed_rpm = 0.0
        self._controlword = 0
        self._averages = [0.0, 0.0]
        self._show()

    def check(self, key: Key, value: int) -> None:
        """Refuse any mode of operation but profile velocity."""
        if key == (MODE, 0) and value != PROFILE_VELOCITY:
            raise AbortError(Abort.INVALID_VALUE)

    def written(self, key: Key, value: int) -> None:
        """Follow the controlword; every other object is read when it is needed."""
        if key == (CONTROLWORD, 0):
            before, self._controlword = self._controlword, value
            was = self.state
            self.state = next_state(was, value, before, quick_stop_option=self._quick_stop_option)
            if self.state is not was:
                self._entered(was)
        elif key == (MODE, 0):
            self.dictionary.put(MODE_DISPLAY, 0, value)
        self._show()

    def fault(self, code: int) -> None:
        """Make transition 13: react according to 0x605E, then hold in fault (14) until it is reset."""
        if self.state in {PowerState.FAULT_REACTION_ACTIVE, PowerState.FAULT}:
            return
        self.dictionary.put(ERROR_CODE, 0, code)
        self.errors.set(code)
        powered = self.state in _POWERED
        self.state = PowerState.FAULT_REACTION_ACTIVE
        option = self.dictionary.get(FAULT_REACTION_OPTION, missing=_QUICK_STOP_RAMP) if powered else 0
        self._stop_rpm_per_s = self._ramp({1: DECELERATION, 2: QUICK_STOP_DECELERATION}.get(option))
        self._settle()
        self._show()

    def connection_lost(self) -> None:
        """React according to 0x6007."""
        option = self.dictionary.get(ABORT_CONNECTION_OPTION, missing=3)
        was = self.state
        if option == 1:
            self.fault(HEARTBEAT_LOST)
        elif option == 2:
            self.state = next_state(was, 0x0000, 0, quick_stop_option=0)
        elif option == 3:
            self.state = next_state(was, 0x0002, 0, quick_stop_option=0)
        if option in {2, 3} and self.state is not was:
            self._entered(was)
            self._show()

    def advance(self, elapsed_s: float) -> None:
        """Follow the ramp for a while."""
        goal, slope = self._goal()
        change = goal - self.speed_rpm
        step = slope * elapsed_s
        self.speed_rpm = goal if abs(change) <= step else self.speed_rpm + math.copysign(step, change)
        self._since_measured_s += elapsed_s
        self._settle()
        self._show()

    def measure(self, measurement: Measurement) -> None:
        """Put current, voltage and temperature into the dictionary."""
        wheel = self.wheel or 0
        current_A = self.direction * float(measurement.motor_current_A[wheel])
        weight = 1 - math.exp(-self._since_measured_s / AVERAGING_S)
        self._since_measured_s = 0.0
        for place, value in enumerate((1000 * current_A, self.speed_rpm)):
            self._averages[place] += weight * (value - self._averages[place])
        self.dictionary.put(CURRENT_AVERAGED, 0, self._averages[0])
        self.dictionary.put(VELOCITY_AVERAGED, 0, self._averages[1])
        self.put_quantity(MOTOR_CURRENT.name, current_A)
        self.put_quantity(BUS_VOLTAGE.name, measurement.bus_voltage_V)
        self.put_quantity(MOTOR_TEMPERATURE.name, float(measurement.motor_temperature_degC[wheel]))

    @property
    def _quick_stop_option(self) -> int:
        return self.dictionary.get(QUICK_STOP_OPTION, missing=_QUICK_STOP_RAMP)

    @property
    def _rpm_per_unit(self) -> float:
        """Rpm of one velocity unit of the drive."""
        place = self.places.get(MOTOR_SPEED.name)
        return 1.0 if place is None else self.factor(place.scale) / RAD_S_PER_RPM

    def _ramp(self, index: int | None) -> float:
        """Return a ramp [rpm/s] from its object, in velocity units per second; 0, or no object, is no ramp."""
        slope = 0 if index is None else self.dictionary.get(index, missing=0)
        return slope * self._rpm_per_unit or COASTING_RPM_PER_S

    def _entered(self, was: PowerState) -> None:
        """Choose how the motor stops in the state just entered, and clear what a fault reset ends."""
        get = self.dictionary.get
        option: int | None = None
        if self.state is PowerState.QUICK_STOP_ACTIVE:
            code = self._quick_stop_option
            option = {1: DECELERATION, 2: QUICK_STOP_DECELERATION, 5: DECELERATION, 6: QUICK_STOP_DECELERATION}.get(
                code
            )
        elif self.state is PowerState.SWITCHED_ON and get(DISABLE_OPTION, missing=0) == 1:
            option = DECELERATION
        self._stop_rpm_per_s = self._ramp(option)
        if was is PowerState.FAULT:
            self.dictionary.put(ERROR_CODE, 0, 0)
            self.errors.clear()
        self._settle()

    def _settle(self) -> None:
        """Make the transitions that the drive makes by itself once it stands still: 12 and 14."""
        if self.speed_rpm:
            return
        if self.state is PowerState.FAULT_REACTION_ACTIVE:
            self.state = PowerState.FAULT
        elif self.state is PowerState.QUICK_STOP_ACTIVE and self._quick_stop_option not in STAYS_IN_QUICK_STOP:
            self.state = PowerState.SWITCH_ON_DISABLED

    def _goal(self) -> tuple[float, float]:
        """Return the speed that the drive goes for, and the ramp's slope [rpm/s]."""
        if self.state is not PowerState.OPERATION_ENABLED:
            return 0.0, self._stop_rpm_per_s
        get = self.dictionary.get
        limit = get(MAX_VELOCITY, missing=0) or _NO_LIMIT
        goal = 0 if self._controlword & HALT else min(max(get(TARGET_VELOCITY), -limit), limit)
        goal_rpm = goal * self._rpm_per_unit
        faster = abs(goal_rpm) > abs(self.speed_rpm) and goal_rpm * self.speed_rpm >= 0
        return goal_rpm, self._ramp(ACCELERATION if faster else DECELERATION)

    def _show(self) -> None:
        """Put state and speed into the dictionary."""
        goal, _ = self._goal()
        word = self.state.value | _REMOTE
        if self.state in _POWERED:
            word |= _VOLTAGE_ENABLED
        if self.speed_rpm == goal:
            word |= _TARGET_REACHED
        if not self.speed_rpm:
            word |= _SPEED_ZERO
        speed = self.speed_rpm / self._rpm_per_unit
        self.dictionary.put(STATUSWORD_OBJECT, 0, word)
        self.dictionary.put(VELOCITY_ACTUAL, 0, speed)
        self.dictionary.put(VELOCITY_DEMAND, 0, speed)


MOTOR_CONTROLLER = Device(
    kind="motor",
    configuration_key="motors",
    eds=EDS_FOLDER / "motor.eds",
    default_node_id=1,
    per_wheel=True,
    tpdos=(
        # 0x2027 and 0x2028, averaged by the controller, may be mapped in place of 0x6078 and 0x606C.
        PdoLayout(
            1,
            (
                Measured(STATUSWORD_OBJECT, 0, STATUSWORD, 1.0),
                Measured(CURRENT, 0, MOTOR_CURRENT, 1e-3),  # mA
                Measured(VELOCITY_ACTUAL, 0, MOTOR_SPEED, RAD_S_PER_RPM),
            ),
        ),
        PdoLayout(
            2,
            (
                Measured(VOLTAGE, 0, BUS_VOLTAGE, 1e-3),  # mV
                Measured(TEMPERATURE, 0, MOTOR_TEMPERATURE, 0.1),  # 0.1 °C
            ),
            diagnostic=True,
        ),
    ),
    # Commands act at once: a quick stop must not wait for a SYNC, nor be lost with it.
    rpdos=(PdoLayout(1, (Commanded(CONTROLWORD), Commanded(TARGET_VELOCITY, scale=RAD_S_PER_RPM)), EVENT_DRIVEN),),
    settings=(
        Setting(MODE, 0, PROFILE_VELOCITY),
        Setting(ABORT_CONNECTION_OPTION, 0, 3),  # on the master's loss: quick stop
        Setting(QUICK_STOP_OPTION, 0, 2),  # brake with the quick-stop ramp, then switch-on disabled
    ),
    monitors_master=True,
    error_texts=_EPOS_ERRORS,
    virtual=VirtualMotorController,
)
