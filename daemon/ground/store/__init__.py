"""The ground's store: one SQLite database of messages, their means over time spans, alarms and logins."""
