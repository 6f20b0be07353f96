"""The page and its API: an operator's desk in a browser. Only `codebotler serve` imports it."""
