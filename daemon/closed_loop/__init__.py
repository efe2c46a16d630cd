"""The loop closed: a rover conceals an effect, the tool finds it, and the daemon reads the ground better."""
