"""The page and its API: an operator's console in a browser. Only `codebotler serve` imports it."""
