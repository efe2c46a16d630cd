"""CAN buses and frames: SocketCAN by its own socket, every other interface through python-can."""

from regolithd.drivers.can.bus import Bus, BusState
from regolithd.drivers.can.frame import Frame
from regolithd.drivers.can.open_bus import open_bus

__all__ = ["Bus", "BusState", "Frame", "open_bus"]
