"""Models of noise: size, autocorrelation and spectrum."""
