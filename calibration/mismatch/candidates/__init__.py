"""Candidates: physics that a simulation may leave out, one file for each effect.

How to add one
--------------
Write one file in this folder with a subclass of `Candidate`; nothing else is edited. The library finds it, and the
search, the answer's sentence, the report, `--corrected` and the documentation take everything else from the class.

    '''Aerodynamic drag.'''

    from typing import ClassVar

    import numpy as np

    from regolithd.calibration.mismatch.candidates.candidate import Array, Candidate, Coefficient, Shape
    from regolithd.calibration.mismatch.problem.problem import Problem


    class AerodynamicDrag(Candidate):
        '''Drag with the square of speed.'''

        name = "aerodynamic-drag"
        covariate = "wheel_speed"
        equation = "Δy = d sign(ω) ω²"
        words = "drag that grows with the square of speed"
        signature = "a residual along the motion that is a parabola over speed"
        experiment = "hold at least four values of the {wheel_speed}, both ways"
        vary = ("wheel_speed", "direction")
        source = "Newton (1687), Book II: resistance of a fluid"
        requires = ("wheel_speed",)
        coefficients: ClassVar = (Coefficient("drag_coefficient", "{unit} {per_speed2}"),)

        def columns(self, problem: Problem, shape: Shape) -> Array:
            '''Return sign(ω) ω².'''
            speed = problem.covariates["wheel_speed"]
            return (speed * np.abs(speed))[None]

An effect of one machine alone belongs beside its simulation: `Simulation.candidates(library)` returns
`(*library, AerodynamicDrag())`.

What an author has to know
--------------------------
- `Candidate` documents every attribute; the ones above have no default.
- `columns` has the shape (coefficient, time, wheel) and is in units of the predicted channel per unit of coefficient.
- A quantity in the law that is not a factor of a column is a shape parameter. `shapes` returns the grid of them that is
  searched; those named in `free` are optimised between the grid's points, within `bounds`.
- `sign` of a coefficient is a law of physics (friction opposes motion), not an expectation.
- Names of columns, covariates and parameters carry their unit (`_s`, `_K`, `_degC`, `_rad_s`).
"""
