"""Physics and fits: drivetrain, wheel and soil, training, and the mismatch tool.

Pure arrays in, arrays out. Nothing here knows CAN, MQTT or asyncio.
"""
