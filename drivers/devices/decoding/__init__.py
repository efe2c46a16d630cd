"""Decoding of CAN frames: the PDOs of each kind of device, and the signals that frames decode to."""
