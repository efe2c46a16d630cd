"""Numbers of CiA 301 (COB-IDs, command specifiers and abort codes of SDO), and of timerfd_create(2).

Written out once more from the source: two ends of this project agree about a number also where both have it from one
wrong constant, so that no test between the master and its virtual nodes could tell.
"""

from __future__ import annotations

import os
import time

from stated_numbers import differing

NUMBERS = {
    "canopen.object_dictionary": {"_FIRST_OBJECT": 0x1000},
    "canopen.pdo": {"MAX_BYTES": 8},
    "canopen.nmt": {"ALL_NODES": 0},
    "canopen.cob_id": {
        "NMT": 0x000,
        "SYNC": 0x080,
        "EMCY": 0x080,
        "TPDO": 0x180,
        "RPDO": 0x200,
        "PDO_STEP": 0x100,
        "SDO_ANSWER": 0x580,
        "SDO_REQUEST": 0x600,
        "ERROR_CONTROL": 0x700,
        "MASTER_NODE_ID": 127,
    },
    "canopen.sdo": {
        "_EXPEDITED_BYTES": 4,
        "_SEGMENT_BYTES": 7,
        "_DOWNLOAD_INITIATE": 1 << 5,
        "_DOWNLOAD_INITIATED": 3 << 5,
        "_DOWNLOAD_SEGMENT": 0 << 5,
        "_DOWNLOADED_SEGMENT": 1 << 5,
        "_UPLOAD_INITIATE": 2 << 5,
        "_UPLOAD_INITIATED": 2 << 5,
        "_UPLOAD_SEGMENT": 3 << 5,
        "_UPLOADED_SEGMENT": 0 << 5,
        "_ABORT": 4 << 5,
        "_BLOCK_UPLOAD_INITIATED": 6 << 5,
        "_SPECIFIER": 7 << 5,
        "_TOGGLE": 1 << 4,
        "_EXPEDITED": 1 << 1,
        "_SIZE_GIVEN": 1,
        "_LAST_SEGMENT": 1,
        "ABORT_TOGGLE": 0x0503_0000,
        "ABORT_TIMEOUT": 0x0504_0000,
        "ABORT_COMMAND": 0x0504_0001,
        "ABORT_LENGTH": 0x0607_0010,
    },
    "canopen.timer": {
        "_CLOCK_MONOTONIC": time.CLOCK_MONOTONIC,
        "_TFD_NONBLOCK": os.O_NONBLOCK,
        "_TFD_TIMER_ABSTIME": 1,
    },
}


def test_numbers_of_a_standard_are_the_standard_s() -> None:
    """Object indices, bits, command specifiers, abort codes, options of a socket."""
    assert differing("drivers", NUMBERS) == {}
