"""Reproduction of the paper: its published results beside recomputed ones (`regolithd reproduce`)."""
