"""`python -m roboeval` is the command `roboeval`."""

from roboeval.cli.app import main

if __name__ == "__main__":
    main()
