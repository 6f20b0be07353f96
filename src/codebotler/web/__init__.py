"""The page and its API: an operator's console in a browser.

Start with `page.py` and `panes/`; `server.py` puts them on a port, behind `guard.py`.
"""
