"""Ways of talking to language models."""
