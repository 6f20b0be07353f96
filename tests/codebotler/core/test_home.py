"""The folder of missions: where it is, and whether anything can be kept there."""

import os
import tempfile
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from codebotler.core.home import make_folder

NOBODY = 65534


def test_a_folder_is_made_with_those_above_it(tmp_path: Path) -> None:
    for _ in range(2):
        make_folder(tmp_path / "state" / "missions")
        assert (tmp_path / "state" / "missions").is_dir()


def test_a_folder_in_which_nothing_can_be_written_is_said() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o555)
        user = os.geteuid()
        os.seteuid(user or NOBODY)  # root may write everywhere
        try:
            with pytest.raises(UserError, match="CODEBOTLER_HOME") as error:
                make_folder(folder)
            assert error.value.file == folder
        finally:
            os.seteuid(user)
            folder.chmod(0o755)
