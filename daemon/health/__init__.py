"""Alarms, throttling of events, task liveness, stuck sensors, and systemd's notification protocol."""
