"""What a simulation states about itself, how SIM.toml names one, and the built-in rover wheel."""
