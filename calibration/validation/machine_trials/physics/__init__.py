"""What the five machines share: their description, the forms of their effects, motions and noise."""
