"""Study of effects out of the library: held-out errors with an empirical curve, and the closed forms suggested."""
