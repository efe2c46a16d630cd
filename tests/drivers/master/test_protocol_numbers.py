"""Numbers of CiA 301 and CiA 402 that the master reads and writes.

Written out once more from the source: two ends of this project agree about a number also where both have it from one
wrong constant, so that no test between the master and its virtual nodes could tell.
"""

from __future__ import annotations

from stated_numbers import differing

NUMBERS = {
    "master.boot_configuration": {
        "SYNC_COB_ID_OBJECT": 0x1005,
        "EMCY_COB_ID_OBJECT": 0x1014,
        "CONSUMER_HEARTBEAT": 0x1016,
        "PRODUCER_HEARTBEAT": 0x1017,
        "PDO_DISABLED": 2**31,
        "_NO_REMOTE_REQUEST": 2**30,
        "_PRODUCES_SYNC": 2**30,
        "_IDENTIFIER": 2**11 - 1,
        "_SYNC_BITS": 2**30 + 2**11 - 1,
        "_EMCY_BITS": 2**31 + 2**11 - 1,
        "_PDOS": 512,
    },
    "master.drive": {"ERROR_HISTORY": 0x1003},
    "master.survey": {"_NAME": 0x1008, "_ERROR_REGISTER": 0x1001, "_ERROR_HISTORY": 0x1003},
    "master.identity": {"_MAJOR": (2**16 - 1) << 16},
    "master.trial": {"_WRITE_ONLY": 0x0601_0001},
    "master.cia402": {"_REMOTE": 1 << 9, "_TARGET_REACHED": 1 << 10, "_SPEED_ZERO": 1 << 12},
}


def test_numbers_of_a_standard_are_the_standard_s() -> None:
    """Object indices, bits, command specifiers, abort codes, options of a socket."""
    assert differing("drivers", NUMBERS) == {}
