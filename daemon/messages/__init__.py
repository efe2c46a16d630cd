"""Every MQTT message and topic, their examples, and the documents made from them."""
