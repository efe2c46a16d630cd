"""Design matrix, normal equations and the noise model: the numbers that the selection works on."""
