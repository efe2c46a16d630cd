"""What has no name, modelled all the same: a curve over its covariate, and closed forms that may describe it.

A decision's smooth term says over which covariate, on which wheels and how something acts. Here it becomes a penalised
spline with a band (`spline.py`), which a corrected simulation may hold (`stated.py`), and closed forms from a small
grammar (`grammar.py`) are fitted in its place and offered as suggestions (`suggestions.py`). Both are functions of one
covariate, so both need only sums in fine bins of that covariate (`sums.py`).
"""
