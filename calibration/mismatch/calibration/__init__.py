"""Where the parameters fit a recording best, and the problem posed there."""
