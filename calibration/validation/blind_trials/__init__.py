"""Blind trials of a mismatch solver: recordings with concealed effects, commitments to the truth, isolation, score.

| module | content |
|---|---|
| `recordings` | generates the recordings; shares no code with the solver |
| `commitment` | commits to the truth by a salted digest before the solver starts |
| `isolation` | runs the solver where it has no access to the truth |
| `batch` | one batch: generate, commit, solve, open, in this order |
| `score`, `table` | compares answers with the truth; tables for the terminal |
| `baselines` | other tools on the same recordings: PySINDy, stepwise BIC, lasso, LISDD |
| `figures` | figures for the documentation |
"""
