"""Bench calibration of load cells, drivetrain and wheel radius: instructions, fits, and the update of `rover.toml`.

| module | content |
|---|---|
| `procedures` | instructions for the bench, and the four fits |
| `line_fit`, `efficiency_fit` | least squares of the steps of a procedure, with standard deviations |
| `from_recording` | a recording (`regolithd export`) → constants of each wheel → updated `rover.toml` |
| `from_corrected_simulation` | a simulation corrected by `regolithd mismatch` → updated `rover.toml` |
| `configuration_update` | sets values in a TOML text; comments and order stay |
| `plot` | figures of measurements and fits |
"""
