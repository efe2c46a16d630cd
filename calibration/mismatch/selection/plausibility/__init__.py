"""What speaks against a set of effects: parameters out of their priors, laws that miss, effects before their cause."""
