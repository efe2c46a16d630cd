"""Numbers of CiA 301 by which the virtual nodes answer.

Written out once more from the source: two ends of this project agree about a number also where both have it from one
wrong constant, so that no test between the master and its virtual nodes could tell.
"""

from __future__ import annotations

from stated_numbers import differing

NUMBERS = {
    "virtual.emcy": {
        "REGISTER": 0x1001,
        "HISTORY": 0x1003,
        "COB_ID_OBJECT": 0x1014,
        "_DISABLED": 2**31,
        "NO_ERROR": 0,
        "HEARTBEAT_LOST": 0x8130,
        "PDO_TOO_SHORT": 0x8210,
        "PDO_TOO_LONG": 0x8220,
    },
    "virtual.pdo": {
        "RPDO": 0x1400,
        "RPDO_MAPPING": 0x1600,
        "TPDO": 0x1800,
        "TPDO_MAPPING": 0x1A00,
        "DISABLED": 2**31,
        "_EXTENDED": 2**29,
        "_COB_ID": 2**11 - 1,
        "LAST_SYNCHRONOUS": 240,
        "_EVENT_DRIVEN": (254, 255),
    },
    "virtual.node": {
        "_DEVICE_TYPE": 0x1000,
        "_SYNC_OBJECT": 0x1005,
        "_CONSUMER": 0x1016,
        "_PRODUCER": 0x1017,
        "_IDENTITY": 0x1018,
        "_ERROR_BEHAVIOUR": 0x1029,
        "_STAYS": 1,
        "_STOPS": 2,
    },
    "virtual.sdo_server": {"_EXPEDITED": 2, "_SIZE_GIVEN": 1, "_TOGGLE": 16, "_LAST": 1, "_SEGMENT": 7},
}


def test_numbers_of_a_standard_are_the_standard_s() -> None:
    """Object indices, bits, command specifiers, abort codes, options of a socket."""
    assert differing("drivers", NUMBERS) == {}
