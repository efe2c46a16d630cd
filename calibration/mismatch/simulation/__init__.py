"""What a simulation states about itself, the built-in rover wheel, and the problem that the two make with a recording."""
