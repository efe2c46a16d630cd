"""Slow noise beside what the tool finds: how often it is told as something, and which effects it hides."""
