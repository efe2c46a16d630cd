"""The CAN bus: frames, SocketCAN and python-can buses, error frames, counters."""
