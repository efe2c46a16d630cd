"""The demo (`make demo`): virtual rover, daemon, MQTT broker and subscriber in one process, for 30 s."""
