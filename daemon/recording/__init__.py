"""What is kept: every frame in a candump log, every snapshot, estimate and event in an MCAP file beside it."""
