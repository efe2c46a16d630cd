"""Everything that leaves the rover over MQTT: encoded, kept until acknowledged, delivered in order."""
