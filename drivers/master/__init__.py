"""The CANopen master: boots, supervises and commands the nodes of one bus."""
