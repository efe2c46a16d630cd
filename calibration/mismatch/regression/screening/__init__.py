"""What groups would gain beside a fit, many at once."""
