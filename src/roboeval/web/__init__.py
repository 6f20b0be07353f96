"""Shows the benchmark in a browser: runs side by side, heat maps, and completions with their verdicts.

Start with `pages.py`, which registers the pages and the API. They show snapshots of runs (`snapshot.py`),
which `run_store.py` renews when a file changes.
"""
