"""Alarms on the ground: states and words of ISA-18.2, and the journal of who did what, when."""
