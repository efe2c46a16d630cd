"""What is told of a choice: the answer, with intervals, rivals and what single recordings show."""
