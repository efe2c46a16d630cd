"""Drivetrain of one wheel: torque from motor current (Eq. 11), and the bench procedures that measure its constants."""
