"""The ground: receives what rovers publish, stores it, and shows it on one web page. A process of its own.

    broker ─▶ subscription ─▶ store (SQLite) ─▶ web: history, downloads ─▶ page
                    └──────▶ live state, alarms ─▶ web: server-sent events ─▶ page

`regolithd ground` runs on the operator's computer. It takes the message models from `daemon.messages` and nothing else
of the daemon, and it publishes nothing: no message to a rover starts here.
"""
