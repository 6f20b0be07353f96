"""The operator's console in a browser: a web page and its API.

Start with `page.py` and `panes/`; `server.py` serves them, and `security/guard.py` protects them.
"""
