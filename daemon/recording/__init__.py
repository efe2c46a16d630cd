"""Recording of frames (candump log) and of snapshots, estimates and events (MCAP); replay and export of both."""
