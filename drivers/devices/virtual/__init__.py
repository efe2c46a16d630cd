"""What a virtual device is made of: base class, the measurements it reports, the drive's state machine."""
