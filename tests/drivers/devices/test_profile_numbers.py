"""Numbers of CiA 402 (drives), CiA 404 (measuring devices), CiA 410 (inclinometers) and CiA 303-2 (units).

Written out once more from the source: two ends of this project agree about a number also where both have it from one
wrong constant, so that no test between the master and its virtual nodes could tell.
"""

from __future__ import annotations

import math

from stated_numbers import differing

NUMBERS = {
    "devices.profiles.identity": {
        "DEVICE_TYPE": 0x1000,
        "IDENTITY": 0x1018,
        "ALL_BITS": 2**32 - 1,
        "PROFILE_BITS": 2**16 - 1,
    },
    "devices.device": {"SYNCHRONOUS": 1, "EVENT_DRIVEN": 255},
    "devices.decoding.stated_units": {"_UPLOADED": (2 << 5) + 2 + 1, "_UNUSED_BYTES": 3 << 2},
    "devices.motor_controller": {
        "ABORT_CONNECTION_OPTION": 0x6007,
        "ERROR_CODE": 0x603F,
        "CONTROLWORD": 0x6040,
        "STATUSWORD_OBJECT": 0x6041,
        "QUICK_STOP_OPTION": 0x605A,
        "DISABLE_OPTION": 0x605C,
        "FAULT_REACTION_OPTION": 0x605E,
        "MODE": 0x6060,
        "MODE_DISPLAY": 0x6061,
        "VELOCITY_DEMAND": 0x606B,
        "VELOCITY_ACTUAL": 0x606C,
        "TARGET_VELOCITY": 0x60FF,
        "CURRENT": 0x6078,
        "VOLTAGE": 0x6079,
        "MAX_VELOCITY": 0x607F,
        "ACCELERATION": 0x6083,
        "DECELERATION": 0x6084,
        "QUICK_STOP_DECELERATION": 0x6085,
        "PROFILE_VELOCITY": 3,
        "_QUICK_STOP_RAMP": 2,
        "_NO_LIMIT": 2**31,
        "_VOLTAGE_ENABLED": 1 << 4,
        "_REMOTE": 1 << 9,
        "_TARGET_REACHED": 1 << 10,
        "_SPEED_ZERO": 1 << 12,
        "HEARTBEAT_LOST": 0x8130,
    },
    "devices.virtual.power_state": {"FAULT_RESET": 1 << 7, "HALT": 1 << 8},
    "devices.load_cell": {
        "PROCESS_VALUE": 0x9130,
        "STATUS": 0x6150,
        "OPERATING_MODE": 0x6112,
        "UNIT": 0x6131,
        "DECIMAL_DIGITS": 0x6132,
        "LOWER_LIMIT": 0x9148,
        "UPPER_LIMIT": 0x9149,
        "NOT_VALID": 1,
        "POSITIVE_OVERLOAD": 2,
        "NEGATIVE_OVERLOAD": 4,
        "_NEWTON": 0x21 << 16,
        "_NO_LIMIT": 2**31,
    },
    "devices.inclinometer": {"RESOLUTION": 0x6000, "SLOPE_LONG": 0x6010, "SLOPE_LATERAL": 0x6020},
    "devices.units": {"_STANDARD_GRAVITY": 9.80665, "RAD_S_PER_RPM": math.tau / 60},
    "devices.profiles.shipped": {
        "_MAXON": 0xFB,
        "_DRIVES": 402,
        "_MEASURING_DEVICES": 404,
        "_IO_MODULES": 401,
        "_VELOCITY": 0x606C,
        "_CURRENT": 0x6078,
        "_RPM": 0xA4,
    },
    "devices.eds.write": {"I8": 2, "I16": 3, "I32": 4, "U8": 5, "U16": 6, "U32": 7},
}


def test_numbers_of_a_standard_are_the_standard_s() -> None:
    """Object indices, bits, command specifiers, abort codes, options of a socket."""
    assert differing("drivers", NUMBERS) == {}
