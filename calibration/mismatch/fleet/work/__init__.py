"""What is done recording by recording, on any process or computer: the comparison of each, and its sums."""
