"""The acquisition daemon: drivers in, calibration applied, MQTT and a recording out."""
