"""The problem that a recording and a simulation pose together: prediction, residual, covariates, tangents."""
