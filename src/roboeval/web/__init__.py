"""The benchmark in a browser: runs side by side, heat maps, and every completion with what became of it."""
