"""What has no name: where it acts, what it follows, and whether it comes and goes."""
