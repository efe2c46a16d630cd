"""The command line's commands, one file each: arguments in, exit status out, the work done elsewhere.

A command imports what it needs inside its function, so that `regolithd --help` stays quick and the rover never loads
what only the laptop has.
"""
