"""Blind trials of `regolithd mismatch` on machines that are no rovers: five machines, thirteen kinds of case.

`machines` and `physics` hold the true physics, `first_simulations` what a user would hand over: a class, or an FMU
from C. No line is shared with the solver: it is run as a command, on files. `cases` says what a batch has and makes it,
`batch` seals its truth before the solver starts, and `score` opens it afterwards.
"""
