"""What the recording says of the simulation's own parameters and initial states beside the effects."""
