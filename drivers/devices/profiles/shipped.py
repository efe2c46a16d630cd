"""The profiles that come with regolithd, by kind of device and name.

| kind | profile | devices |
|---|---|---|
| motors | `epos24` | the EPOS-24/1-like drive of the registry: current in mA (0x6078), speed in rpm (0x606C) |
| motors | `epos2` | maxon EPOS2: the same objects; no 0x603F, no 0x605A |
| motors | `epos4` | maxon EPOS4: current in mA (0x30D1:02), speed in the unit of 0x60A9 |
| motors | `cia402` | any drive of CiA 402: current per mille of 0x6075, speed in the unit of 0x60A9, 0x6092 or 0x608F |
| load cells | `newton` | the amplifier of the registry: 0x9130 in 0.01 N |
| load cells | `cia404` | any amplifier of CiA 404: process value in the unit of 0x6131 and 0x6132 |
| load cells | `cia401` | an analogue input of CiA 401 behind a bridge amplifier: 0x6401, with a scale of yours |
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from regolithd.drivers.devices.device import Commanded, KnownIdentity, Measured, Setting, Validity
from regolithd.drivers.devices.eds import EDS_FOLDER
from regolithd.drivers.devices.load_cell import LOAD, LOAD_CELL, NOT_VALID
from regolithd.drivers.devices.motor_controller import (
    ABORT_CONNECTION_OPTION,
    CONTROLWORD,
    MODE,
    MOTOR_CONTROLLER,
    MOTOR_CURRENT,
    MOTOR_SPEED,
    PROFILE_VELOCITY,
    QUICK_STOP_OPTION,
    STATUSWORD,
    STATUSWORD_OBJECT,
    TARGET_VELOCITY,
)
from regolithd.drivers.devices.profiles.profile import Profile, Source, built_in
from regolithd.drivers.devices.units import (
    ENCODER,
    FEED,
    FEED_AND_GEAR,
    RAD_S_PER_RPM,
    RATED_CURRENT,
    SI_VELOCITY,
    process_unit,
)

if TYPE_CHECKING:
    from regolithd.drivers.devices.device import Device

_MAXON = 0xFB  # vendor-ID
_DRIVES, _MEASURING_DEVICES, _IO_MODULES = 402, 404, 401  # CiA device profiles
_VELOCITY, _CURRENT = 0x606C, 0x6078
_RPM = 0xA4  # dimension index of 0x608C in CiA 402 version 1
_SPEED_CURE = 'State the unit in [devices.motors.objects]: `motor_speed_rad_s = {unit = "rpm"}`; or a scale to rad/s'
_CURRENT_CURE = (
    'State object and unit in [devices.motors.objects]: `motor_current_A = {object = "0x6078", unit = "mA"}`'
)
_LOAD_CURE = (
    'State object and unit in [devices.load_cells.objects]: `load_N = {{object = "0x9130:{:02X}", unit = "N"}}`'
)
_SCALE_CURE = (
    "State newtons per digit, from the bridge amplifier: `load_N = {scale = 0.0125}` in [devices.load_cells.objects]"
)

_STATUS = Source(STATUSWORD, (Measured(STATUSWORD_OBJECT, 0, STATUSWORD, 1.0),))
_COMMANDS = (Commanded(CONTROLWORD), Commanded(TARGET_VELOCITY))
_DRIVE_SETTINGS = (
    Setting(MODE, 0, PROFILE_VELOCITY),
    Setting(ABORT_CONNECTION_OPTION, 0, 3),  # on the master's loss: quick stop
    Setting(QUICK_STOP_OPTION, 0, 2),  # brake with the quick-stop ramp, then switch-on disabled
)

EPOS24 = built_in(MOTOR_CONTROLLER, "epos24", MOTOR_SPEED)
EPOS2 = Profile(
    name="epos2",
    kind="motor",
    description="maxon EPOS2",
    eds=EDS_FOLDER / "epos2.eds",
    sources=(
        _STATUS,
        Source(MOTOR_CURRENT, (Measured(_CURRENT, 0, MOTOR_CURRENT, 1e-3),)),
        Source(MOTOR_SPEED, (Measured(_VELOCITY, 0, MOTOR_SPEED, RAD_S_PER_RPM),)),
    ),
    commands=_COMMANDS,
    command_unit_of=MOTOR_SPEED,
    settings=(*_DRIVE_SETTINGS, Setting(0x608B, 0, 0), Setting(0x608C, 0, _RPM)),
    identity=KnownIdentity(_DRIVES, _MAXON, revisions=(0x2000_0000, 0x21FF_FFFF)),
    error_texts=MOTOR_CONTROLLER.error_texts,
)
EPOS4 = Profile(
    name="epos4",
    kind="motor",
    description="maxon EPOS4",
    eds=EDS_FOLDER / "epos4.eds",
    sources=(
        _STATUS,
        Source(MOTOR_CURRENT, (Measured(0x30D1, 2, MOTOR_CURRENT, 1e-3),)),
        Source(MOTOR_SPEED, (Measured(_VELOCITY, 0, MOTOR_SPEED, SI_VELOCITY),), cure=_SPEED_CURE),
    ),
    commands=_COMMANDS,
    command_unit_of=MOTOR_SPEED,
    settings=_DRIVE_SETTINGS,
    identity=KnownIdentity(_DRIVES, _MAXON, revisions=(0x0100_0000, 0x01FF_FFFF)),
    error_texts=MOTOR_CONTROLLER.error_texts,
)
CIA402 = Profile(
    name="cia402",
    kind="motor",
    description="any drive of CiA 402",
    eds=EDS_FOLDER / "cia402.eds",
    sources=(
        _STATUS,
        Source(
            MOTOR_CURRENT,
            (Measured(_CURRENT, 0, MOTOR_CURRENT, RATED_CURRENT),),
            cure=_CURRENT_CURE,
        ),
        Source(
            MOTOR_SPEED,
            tuple(Measured(_VELOCITY, 0, MOTOR_SPEED, unit) for unit in (SI_VELOCITY, FEED_AND_GEAR, FEED, ENCODER)),
            cure=_SPEED_CURE,
        ),
    ),
    commands=_COMMANDS,
    command_unit_of=MOTOR_SPEED,
    settings=_DRIVE_SETTINGS,
    identity=KnownIdentity(_DRIVES),
)
NEWTON = built_in(LOAD_CELL, "newton")


def _cia404(channel: int) -> Profile:
    return Profile(
        name="cia404",
        kind="load-cell",
        description="any amplifier of CiA 404",
        eds=EDS_FOLDER / "cia404.eds",
        sources=(
            Source(
                LOAD,
                (
                    Measured(0x9130, channel, LOAD, process_unit(channel)),
                    Measured(0x6130, channel, LOAD, process_unit(channel, fixed_point=False)),
                    Measured(0x7130, channel, LOAD, process_unit(channel)),
                ),
                Validity(0x6150, channel, NOT_VALID | 0x06),
                cure=_LOAD_CURE.format(channel),
            ),
        ),
        settings=(Setting(0x6112, channel, 1),),
        identity=KnownIdentity(_MEASURING_DEVICES),
    )


def _cia401(channel: int) -> Profile:
    return Profile(
        name="cia401",
        kind="load-cell",
        description="an analogue input of CiA 401 behind a bridge amplifier",
        eds=EDS_FOLDER / "cia401.eds",
        sources=(Source(LOAD, (Measured(0x6401, channel, LOAD, 0.0),), cure=_SCALE_CURE),),
        settings=(Setting(0x6423, 0, 1),),  # analogue inputs may be transmitted by PDO
        identity=KnownIdentity(_IO_MODULES),
    )


@cache
def profiles(device: Device, channel: int = 1) -> tuple[Profile, ...]:
    """Return the profiles of a kind of device; the first is the one that counts where none is named."""
    if device.kind == MOTOR_CONTROLLER.kind:
        return (EPOS24, EPOS2, EPOS4, CIA402)
    if device.kind == LOAD_CELL.kind:
        return (NEWTON, _cia404(channel), _cia401(channel))
    return (built_in(device, "own"),)
