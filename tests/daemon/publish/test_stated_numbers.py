"""Times, limits and reason codes of publishing.

Users see them in what the daemon does and in the documentation, so that a change of one is told in the CHANGELOG.
"""

from __future__ import annotations

import socket

from stated_numbers import differing

NUMBERS = {
    "broker_client": {  # reason codes of MQTT 5, 2.4
        "_UNSUPPORTED_PROTOCOL_VERSION": 0x84,
        "_NOT_AUTHORIZED": 0x87,
        "_QUOTA_EXCEEDED": 0x97,
    },
    "connection_errors": {"_CREDENTIALS_CODES": (0x86, 0x87), "_SESSION_TAKEN_OVER": 0x8E},
    "connection": {
        "WINDOW": 64,
        "OTHERS_WINDOW": 16,
        "MAX_LATE_PER_S": 1000,
        "_AT_LEAST_ONCE": 1,
    },
    "transport": {"TCP_OPTIONS": ((socket.IPPROTO_TCP, socket.TCP_NODELAY, 1),)},
    "publisher": {"STABLE_CONNECTION_S": 5, "DISK_SYNC_PERIOD_S": 1},
    "mqtt_sink": {
        "HEALTH_PERIOD_S": 1,
        "CLOCK_JUMP_NS": 0.5e9,
        "CLOCK_JUMP_ALARM_S": 60,
        "SOIL_CHANGE_ALARM_S": 120,
        "BROKER_ALARM_S": 10,
    },
    "outbox": {"LIVE_WITHIN_NS": 1e9},
    "stores": {"SHARE_OF_OTHERS": 0.1},
}


def test_stated_numbers_are_those_of_the_code() -> None:
    """Each with the unit that its name ends in."""
    assert differing("daemon.publish", NUMBERS) == {}
