"""Cases: what each conceals and how strongly, and the files that a solver may see of it."""
