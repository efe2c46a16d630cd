"""COB-IDs of the predefined connection set (CiA 301, 7.3.3): which service has which CAN identifier.

    0x000 NMT   0x080 SYNC   0x081–0x0FF EMCY   0x180–0x57F PDOs   0x580–0x67F SDO   0x701–0x77F NMT error control

All but NMT and SYNC are a base plus the node-ID.
"""

from __future__ import annotations

NMT = 0x000
SYNC = 0x080
EMCY = 0x080  # + node-ID
TPDO = 0x180  # + node-ID: TPDO 1; the next ones follow in steps of `PDO_STEP`
RPDO = 0x200  # + node-ID: RPDO 1
PDO_STEP = 0x100
SDO_ANSWER = 0x580  # + node-ID: from the node's SDO server
SDO_REQUEST = 0x600  # + node-ID: to the node's SDO server
ERROR_CONTROL = 0x700  # + node-ID: boot-up message and heartbeat

MASTER_NODE_ID = 127  # the daemon's own, where nothing else is configured
