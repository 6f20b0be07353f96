"""The command line of CodeBotler."""

from __future__ import annotations

from typing import Annotated

import typer

from codebotler import __version__

app = typer.Typer(rich_markup_mode=None, add_completion=False, pretty_exceptions_enable=False)


@app.callback(invoke_without_command=True)
def codebotler(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Robot programs from plain words; so far a library, and the engine of `roboeval`."""
    print(f"codebotler {__version__}" if version else context.get_help())


def main() -> None:
    """Run the command line."""
    app()


if __name__ == "__main__":
    main()
