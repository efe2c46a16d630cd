"""The posterior of cohesion, friction angle and drawbar margin: simulated rovers, training, estimator."""
