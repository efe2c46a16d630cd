"""The virtual rover's nodes: real CANopen nodes, built from the EDS files that the drivers read."""
