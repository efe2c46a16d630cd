"""What a corrected simulation brings with it: curves, onsets, and sizes with their uncertainty."""
