"""Changes of the prediction with parameters and variants."""
