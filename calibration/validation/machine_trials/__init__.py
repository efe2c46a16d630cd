"""Blind trials of `regolithd mismatch` on machines that are no rovers: five machines, thirteen kinds of case.

`machines` holds the true physics of each, `first_simulations` what a user would hand over: a class, or an FMU from C.
No line is shared with the solver: it is run as a command, on files. `plan` says which cases a batch has, `generator`
makes one, `batch` seals its truth before the solver starts, and `score` opens it afterwards.
"""
