"""Terramechanics: rigid wheel on deformable soil, soil parameters, wheel loads, drawbar pull.

| module | equations |
|---|---|
| `wheel_soil` | stresses under the wheel, load, torque, contact angle (Eqs 1, 6, 7; Bernstein–Wong pressure–sinkage) |
| `drawbar` | thrust, resistance, drawbar pull and margin (integrals of Eqs 4 and 5) |
| `wheel_loads` | weight on six wheels on a slope |
| `soils` | soil parameters as arrays, and the prior distribution of soils |

Equation numbers are those of the paper [1]_; symbols are in `docs/nomenclature.md`.

References
----------
.. [1] "Estimating terrain parameters for a rigid wheeled rover using neural networks", Journal of Terramechanics 50
   (2013) 165–174.
"""
