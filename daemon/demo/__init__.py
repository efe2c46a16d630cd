"""`make demo`: virtual rover, daemon, broker and subscriber in one process, for half a minute, nothing installed."""
