"""The local control socket: the only way to move the rover."""
