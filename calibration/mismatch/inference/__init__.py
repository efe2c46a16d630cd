"""What is said of a set of effects: intervals, identifiability, sensitivity, held-out errors, experiments."""
