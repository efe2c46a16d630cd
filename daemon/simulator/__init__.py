"""Simulator of the virtual rover: scenario file, wheel–soil physics, sensor noise, ground truth."""
