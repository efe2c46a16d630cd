"""Physics that a simulation may leave out: one small file for each effect.

A new one is a subclass of `Candidate` in a file of its own here, or anywhere for a simulation's own `candidates()`.
"""
