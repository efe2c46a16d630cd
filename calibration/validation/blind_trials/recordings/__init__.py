"""Generator of recordings with concealed effects: traverse, wheel on soil, effects, sensors, files.

It imports nothing of the solver that is tested with its recordings: its laws and its numerical methods are others.
"""
