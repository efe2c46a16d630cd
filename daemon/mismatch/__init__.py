"""`regolithd mismatch`: files in, comparison, files and text out. The comparison itself is `calibration.mismatch`."""
