"""Laws that hold or fail in a range of a covariate alone."""
