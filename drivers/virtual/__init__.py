"""The virtual rover's nodes: real CANopen nodes, built from the EDS files that the drivers read.

    rover          all nodes behind one bus: the one task that does input and output
    node           one node: network management, SDO, PDO, EMCY, heartbeats around a device
    device, motor_controller, power_state      what the devices do
    plant          the world, handed in
    tell, faults   what can be made wrong, by command

Apart from `rover.run` everything is plain code without a clock, a bus or a thread.
"""

from regolithd.drivers.virtual.plant import Bench, Measurement, Plant
from regolithd.drivers.virtual.rover import KAPVIK, VirtualRover

__all__ = ["KAPVIK", "Bench", "Measurement", "Plant", "VirtualRover"]
