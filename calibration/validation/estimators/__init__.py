"""Evaluation of the soil estimators and of the soil-change alarm on held-out simulated rovers (`regolithd evaluate`).

| module | question |
|---|---|
| `errors_and_coverage` | errors, coverage and ranks of posterior, paper's network and least squares |
| `bias` | bias of the friction angle by the noise of the current |
| `drivetrain` | error of the cohesion by an uncalibrated no-load current |
| `change_detector` | delay of the soil-change alarm at one false alarm in 8 h |
| `simulated_drives` | long drives for the alarm |
| `paper_network` | the paper's network, loaded once |
| `pictures` | figures for the documentation |
"""
