"""`python -m codebotler` is the command `codebotler`."""

from codebotler.cli.app import main

if __name__ == "__main__":
    main()
