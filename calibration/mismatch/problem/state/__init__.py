"""A state of the simulation: how it begins, what a gap does to it, and how long it remembers an input."""
