"""What a simulation states about itself, the built-in rover wheel, and the problem posed with a recording."""
