"""CANopen services (CiA 301): NMT, SYNC, heartbeat, EMCY, SDO, PDO, object dictionaries."""
