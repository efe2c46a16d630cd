"""Columns in a file, and their sums of products."""
