"""The paper's published results: Tables 3–6, the network's size and MSE, record 500."""

from __future__ import annotations

import numpy as np

PAIRS = 504
NEURONS = 64
MEAN_MSE = 0.0251
RECORDS = 909
DURATION_S = 454.54
SLIP = 0.025

SET_500 = {"load_N": 31.6, "slip": SLIP, "motor_current_A": 0.080, "cohesion_Pa": 3352.0, "friction_angle_deg": 28.6}
"""Record 500 of wheel 5 on prepared ground: inputs and the paper's estimate."""

WHEELS = np.arange(1, 7)
COHESION_PA = {"prepared": (3832, 3849, 3726, 3644, 3641, 3737), "unprepared": (3861, 3931, 3722, 3693, 3632, 3711)}
COHESION_RSD = {"prepared": (7.6, 13.1, 6.4, 7.8, 6.7, 11.5), "unprepared": (10.0, 17.5, 6.7, 9.4, 6.1, 7.6)}
ANGLE_DEG = {"prepared": (27.5, 26.6, 27.8, 26.5, 27.7, 26.2), "unprepared": (27.0, 25.8, 27.8, 26.3, 27.7, 27.2)}
ANGLE_RSD = {"prepared": (8.4, 13.2, 6.5, 9.4, 6.9, 11.4), "unprepared": (10.4, 16.3, 6.5, 10.3, 6.2, 7.7)}
CURRENT_RSD = {"prepared": (31.2, 38.8, 31.3, 36.5, 31.2, 35.1), "unprepared": (33.4, 42.4, 31.6, 36.1, 30.7, 29.2)}
LOAD_RSD = {"prepared": (14.2, 11.9, 9.6, 7.0, 6.7, 7.2), "unprepared": (16.1, 14.7, 9.3, 9.4, 6.6, 7.2)}
