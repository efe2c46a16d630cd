"""The control socket, a local UNIX socket: the only way to command the rover."""
