"""The report of many recordings: what was found on which rovers, since when, and how large in each recording."""
