"""The benchmark in a browser: runs side by side, heat maps, and every completion with what became of it.

`pages.py` puts the pages and the API at their addresses. All of them show snapshots of runs (`snapshot.py`),
which `run_store.py` reads again when a file has changed. Start with `pages.py`.
"""
