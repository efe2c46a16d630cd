"""What comes and goes in a course of readings."""
