"""Other answers to the same recording: which, how probable, and the experiment that tells them apart."""
