"""Groups of columns: candidates, smooth terms, lagged terms, and those that act on a state."""
