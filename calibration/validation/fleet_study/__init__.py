"""A season of five virtual rovers, compared together: `make fleet`.

Two rovers have a bearing that wears, one a cold gearbox, one a change of grease half way, and one nothing.
"""
