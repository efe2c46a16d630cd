"""Network management (CiA 301, 7.2.8 and 7.3.2): commands to nodes, and the states that they report.

A command is a frame of two bytes on COB-ID 0: command specifier and node-ID (0 for all nodes).
A node reports its state in a one-byte frame on 0x700 + node-ID: as its heartbeat, and once, with 0, as it boots up.
"""

from __future__ import annotations

from enum import IntEnum

from regolithd.drivers.can.frame import Frame
from regolithd.drivers.canopen import cob_id

ALL_NODES = 0


class NmtCommand(IntEnum):
    """NMT command specifiers (CiA 301, 7.2.8.2.1)."""

    START = 0x01  # to operational: PDOs flow
    STOP = 0x02  # neither PDO nor SDO, only NMT and heartbeat
    ENTER_PRE_OPERATIONAL = 0x80  # SDO, no PDO
    RESET_NODE = 0x81  # as after power-on: application and communication
    RESET_COMMUNICATION = 0x82


class NmtState(IntEnum):
    """NMT states as reported by a node (CiA 301, 7.2.8.3.2.2); boot-up once, on entering pre-operational."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F

    @property
    def text(self) -> str:
        """The state as text, such as `pre-operational`."""
        return self.name.lower().replace("_", "-")


def command_frame(command: NmtCommand, node_id: int = ALL_NODES) -> Frame:
    """Return the frame of an NMT command to `node_id` (0: all nodes)."""
    return Frame(0, cob_id.NMT, bytes((command, node_id)))


def state_frame(state: NmtState, node_id: int) -> Frame:
    """Return the heartbeat (or boot-up) frame of `node_id`."""
    return Frame(0, cob_id.ERROR_CONTROL + node_id, bytes((state,)))


def parse_state(data: bytes) -> NmtState | None:
    """Return the state in an error-control frame, or None where CiA 301 has no such state.

    The top bit is node guarding's toggle, which a heartbeat keeps at 0; it is masked.
    """
    if len(data) != 1:
        return None
    try:
        return NmtState(data[0] & 0x7F)
    except ValueError:
        return None
