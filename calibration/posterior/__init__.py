"""The posterior of cohesion, friction angle and drawbar margin: simulated rovers, training, and the estimator on the rover."""
