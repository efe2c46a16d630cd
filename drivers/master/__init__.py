"""The CANopen master: a network of booted, supervised and commanded nodes."""

from regolithd.drivers.master.network import Network
from regolithd.drivers.master.status import NetworkCounters, NetworkSettings, NodePhase, NodeStatus

__all__ = ["Network", "NetworkCounters", "NetworkSettings", "NodePhase", "NodeStatus"]
