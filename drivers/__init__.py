"""CAN, CANopen and the nodes on the rover's bus, real and virtual.

The drivers know no soil and no MQTT. Each folder imports only those above it in this table:

| folder | standard | content |
|---|---|---|
| `can/` | linux/can.rst | frames, and buses to receive and send them: SocketCAN, python-can |
| `canopen/` | CiA 301, 306 | one module for each service: NMT, SYNC, heartbeat, EMCY, SDO, PDO; object dictionaries |
| `devices/` | CiA 402, 404, 410 | one file for each kind of device, one registry; decoding to SI values |
| `master/` | CiA 302-2, 402-2 | the network: boots, supervises and commands the nodes |
| `virtual/` | CiA 301 | virtual nodes with the same EDS files, for tests, demo and bench |

`errors` is the tree of exceptions; `reference` writes `docs/reference/bus.md`; `benchmark` measures the time per frame.
"""
