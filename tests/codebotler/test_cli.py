"""The command line of CodeBotler: so far its help and its version."""

import re
import subprocess
import sys

import pytest

from codebotler.cli import app, obey


def codebotler(*arguments: str) -> tuple[int, str, str]:
    ended = subprocess.run(
        [sys.executable, "-m", "codebotler.cli", *arguments], capture_output=True, text=True, check=False
    )
    return ended.returncode, ended.stdout, ended.stderr


@pytest.mark.parametrize("arguments", [(), ("--help",)])
def test_help_offers_no_command_while_there_is_none(arguments: tuple[str, ...]) -> None:
    status, out, err = codebotler(*arguments)
    assert (status, err) == (0, "")
    assert out.startswith("Usage: codebotler [OPTIONS]\n")


def test_the_version() -> None:
    assert re.fullmatch(r"codebotler \d+\.\d+\.\d+\n", codebotler("--version")[1])


def test_what_is_no_command_is_one_sentence() -> None:
    status, out, err = codebotler("dance")
    assert (status, out) == (2, "")
    assert err.startswith("codebotler: got unexpected extra argument")
    assert err.count("\n") == 1


def test_windows_is_told_of_wsl_with_the_platform_patched(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    with pytest.raises(SystemExit) as end:
        obey(app, "codebotler")
    assert end.value.code == 1
    assert (
        capsys.readouterr().err == "codebotler: this runs on Linux and macOS; on Windows, use it inside WSL\n"
    )
