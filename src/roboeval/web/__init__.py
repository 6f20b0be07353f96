"""The benchmark in a browser: runs side by side, heat maps, and every completion with its verdicts.

Start with `pages.py`, which adds the pages and the API. All of them show snapshots of runs (`snapshot.py`),
which `run_store.py` reads again when a file changes.
"""
