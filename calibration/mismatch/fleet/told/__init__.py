"""What is told of a choice: the answer, with sizes, intervals and rivals."""
