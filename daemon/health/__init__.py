"""Alarms, task liveness, stuck sensors, and systemd's notification protocol."""
