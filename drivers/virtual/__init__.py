"""The virtual rover: CANopen nodes in software, with the EDS files that the master reads.

    rover                          all nodes on one bus: the one task that does input and output
    node, sdo_server, pdo, emcy    one node: the CiA 301 services around a virtual device (`devices.virtual`)
    object_dictionary              the values of a node's objects
    real_nodes                     what real nodes beside them report
    plant                          interface to the physics, which is passed in
    faults, fault_injection, fault_socket    faults of a node, and the commands that inject them

Apart from `rover.run` and `fault_socket` the code has no clock, bus or thread.
"""

from regolithd.drivers.virtual.plant import Bench, Measurement, Plant
from regolithd.drivers.virtual.rover import KAPVIK, VirtualRover

__all__ = ["KAPVIK", "Bench", "Measurement", "Plant", "VirtualRover"]
