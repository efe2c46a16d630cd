"""Frames to estimates: acquire, torque, smooth, slip, estimate. Pure functions of the frame stream."""
