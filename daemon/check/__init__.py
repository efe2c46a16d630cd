"""The checks of `regolithd check`, one module each; they change, move and publish nothing."""
