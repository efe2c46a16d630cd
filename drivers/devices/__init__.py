"""The kinds of device on the bus: one file each, listed in `registry`, and what follows from them."""
