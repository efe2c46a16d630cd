"""The sub-commands of `regolithd`, one module each: options, error messages and exit status.

Each module has `register(app)`. A command imports what it needs inside its function, so that `regolithd --help` is
quick and the rover's computer does not load libraries that only the laptop has.
"""
