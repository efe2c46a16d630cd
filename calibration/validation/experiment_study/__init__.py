"""Study of proposed experiments: a recording at one speed, then the same rover in three experiments of equal length.

choices (what to drive; knows no solver) ─▶ trials (drive it, let the solver answer) ─▶ score ─▶ picture
"""
