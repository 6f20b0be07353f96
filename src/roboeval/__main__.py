"""Runs the command `roboeval` when called as `python -m roboeval`."""

from roboeval.cli.app import main

if __name__ == "__main__":
    main()
