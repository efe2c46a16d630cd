"""The web server of the ground: page, history, downloads, live updates, alarm actions, login."""
