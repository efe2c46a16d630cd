"""Procedures at the test bench that give the constants: what to do, what to measure, and the fit.

Each fit takes arrays from a recording (the columns of `regolithd export`), and returns values with their standard
deviations. `toml_edit` writes them where the daemon reads them.
"""
