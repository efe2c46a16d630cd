"""CAN, CANopen and the nodes on the rover's bus – and their virtual twins.

Nothing here knows what soil is, or where the values go afterwards. From the wire upwards:

| file | reads beside | is |
|---|---|---|
| `frame`, `bus`, `socketcan`, `kernel_batch`, `adapter`, `error_frame`… | linux/can.rst | frames, in and out |
| `nmt`, `heartbeat`, `sync`, `timer`, `emcy`, `sdo`, `sdo_client`, `pdo` | CiA 301 | one service each |
| `dictionary`, `eds/` | CiA 306 | what a node has |
| `cia402`, `drive`, `motion` | CiA 402-2 | the motor controllers: the state machine, one drive, all of them |
| `decode`, `signals` | CiA 301, 404, 410 | frames to SI values; pure, so that a log replays to the same bits |
| `boot`, `boot_reason`, `configuration`, `link`, `supervisor` | CiA 302-2 | one node: booted, watched, booted again |
| `network`, `events`, `status`, `probe`, `load` | | all nodes, and what is told of them |
| `errors` | | everything that can go wrong, in one tree |
| `virtual/` | CiA 301, 402, 404, 410 | the same nodes without hardware |
| `benchmark` | | what a frame costs |
"""
