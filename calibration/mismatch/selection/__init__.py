"""Which set of effects: subset selection, shape optimisation, sign-flip test, cross-validation, smooth terms."""
