"""What `regolithd check` looks at, one file for each; nothing is changed, moved or published."""
