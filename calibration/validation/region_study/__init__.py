"""Machines whose law fails in one or several regions: what `regolithd mismatch` and LISDD say of them."""
