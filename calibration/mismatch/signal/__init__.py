"""Analysis of time series that candidates and regression share: noise and autocorrelation, spectrum, hat basis."""
