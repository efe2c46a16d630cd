"""Acquisition daemon of a micro-rover, and the tool that finds the physics a simulation leaves out.

The three sub-packages are links to the folders at the top of the project: `drivers`, `daemon`, `calibration`.
"""

import os

# onnxruntime from 1.29 on sends reports of its use to its maker, from a thread and a database in the user's cache
# folder, unless this is set before it is imported. Set it to 0 to allow that.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
