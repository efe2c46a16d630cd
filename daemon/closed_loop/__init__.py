"""End-to-end study: hide a drivetrain effect, find it by `mismatch`, correct `rover.toml`, compare the estimates."""
