"""Acquisition daemon of a micro-rover, and the tool that finds the physics a simulation leaves out.

The three sub-packages are links to the folders at the top of the project: `drivers`, `daemon`, `calibration`.
"""
