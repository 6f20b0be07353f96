"""Mutation testing of suites: right programs made wrong as models get them wrong, and which of them pass."""
