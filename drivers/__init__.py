"""CAN, CANopen and the nodes on the rover's bus – and their virtual twins.

Nothing here knows what soil is, or where the values go afterwards.
"""
