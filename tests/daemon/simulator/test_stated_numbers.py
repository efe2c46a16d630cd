"""Constants of the virtual rover and of the brake.

Users see them in what the daemon does and in the documentation, so that a change of one is told in the CHANGELOG.
"""

from __future__ import annotations

from stated_numbers import differing

NUMBERS = {
    "virtual_rover": {
        "STANDSTILL_RAD_S": 0.05,
        "STALL_CURRENT_A": 1,
        "WARMING_TIME_S": 600,
        "SENSOR_CORRELATION_S": 0.05,
        "SKID_STEERING": 0.6,
    },
    "brake": {
        "PERIOD_S": 0.1,
        "RETRY_S": 2,
        "RATED_PERMILLE": 1000,
        "TORQUE_MODES": ((4, 1 << 3), (10, 1 << 9)),  # CiA 402: 0x6060, and the mode's bit of 0x6502
        "_DEVICE_TYPE": 0x1000,
        "_DRIVE": 402,
        "_HEARTBEAT_CONSUMER": 0x1016,
        "_ABORT_CONNECTION": 0x6007,
        "_DISABLE_VOLTAGE": 2,
        "_ERROR_CODE": 0x603F,
        "_CONTROLWORD": 0x6040,
        "_STATUSWORD": 0x6041,
        "_MODE": 0x6060,
        "_MODE_DISPLAY": 0x6061,
        "_TARGET_TORQUE": 0x6071,
        "_MAX_TORQUE": 0x6072,
        "_RATED_TORQUE": 0x6076,
        "_SUPPORTED_MODES": 0x6502,
    },
    "pdo_frames": {"OPERATION_ENABLED": 0x1237, "FRAME_NS": 130_000},
}


def test_stated_numbers_are_those_of_the_code() -> None:
    """Each with the unit that its name ends in."""
    assert differing("daemon.simulator", NUMBERS) == {}
