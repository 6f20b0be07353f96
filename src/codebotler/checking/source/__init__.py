"""The source of programs, read without running it."""
