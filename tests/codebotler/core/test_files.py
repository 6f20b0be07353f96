"""A read returns text or one clear error; logs and replaced files survive a crash."""

import errno
import os
import re
import tempfile
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from codebotler.core.files import (
    MAX_FILE_BYTES,
    Appender,
    decode_text,
    make_folder,
    open_replacement,
    read_lines,
    read_text,
    sync_folder,
)

NOBODY = 65534


def test_byte_order_mark_is_dropped() -> None:
    assert decode_text(b"\xef\xbb\xbfdef f(): ...\r\n", "f.py") == "def f(): ...\n"


def test_unreadable_file_is_an_error_with_file_and_line(tmp_path: Path) -> None:
    def assert_refused(path: Path, fault: str, line: int | None = None) -> None:
        with pytest.raises(UserError, match=re.escape(fault)) as caught:
            read_text(path)
        assert (caught.value.file, caught.value.line) == (path, line)

    latin, large = tmp_path / "latin.yaml", tmp_path / "large.yaml"
    latin.write_bytes("a: 1\nb: café\n".encode("latin-1"))
    large.write_bytes(b"a" * (MAX_FILE_BYTES + 1))
    assert_refused(tmp_path / "no.yaml", "No such file")
    assert_refused(tmp_path, "Is a directory")
    assert_refused(latin, "UTF-8", 2)
    assert_refused(large, "5,000,000 bytes")
    assert_refused(latin / "inside", "(Not a directory)")


def test_endless_file_is_refused_as_too_large() -> None:
    with pytest.raises(UserError, match=r"/dev/zero: .*\b10 bytes"):
        read_text(Path("/dev/zero"), limit=10)


def test_line_ends_of_every_system_become_newlines(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes("ä\r\nb\rc\n".encode())
    assert read_text(path) == "ä\nb\nc\n"
    assert read_text(path, limit=8) == "ä\nb\nc\n"
    with pytest.raises(UserError, match="7 bytes"):
        read_text(path, limit=7)


@pytest.mark.parametrize("torn", [b"", b"{", b"x" * 100_000])
def test_torn_last_line_is_removed_before_appending(tmp_path: Path, torn: bytes) -> None:
    path = tmp_path / "a.jsonl"
    path.write_bytes(b"1\n2\n" + torn)
    log = Appender(path)
    log.append(b"3\n")
    log.close()
    assert path.read_bytes() == b"1\n2\n3\n"


def test_log_is_locked_before_its_torn_line_is_removed(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    log = Appender(path, exclusive=True)
    path.write_bytes(b"1\n2")
    with pytest.raises(BlockingIOError):
        Appender(path, exclusive=True)
    assert path.read_bytes() == b"1\n2"
    log.close()
    Appender(path, exclusive=True).close()
    assert path.read_bytes() == b"1\n"


def test_line_is_removed_if_the_disk_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.jsonl"
    log = Appender(path)
    log.append(b"1\n")
    real, sizes = os.write, iter([3, None])

    def write_until_full(file: int, data: bytes) -> int:
        size = next(sizes)
        if size is None:
            raise OSError(28, "No space left on device")
        return real(file, data[:size])

    monkeypatch.setattr(os, "write", write_until_full)
    with pytest.raises(OSError, match=re.escape(str(path))):
        log.append(b"12345\n")
    monkeypatch.undo()
    log.close()
    assert path.read_bytes() == b"1\n"


def test_unfinished_replacement_keeps_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt), open_replacement(path):
        raise KeyboardInterrupt
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_make_folder_creates_missing_parents(tmp_path: Path) -> None:
    for _ in range(2):
        make_folder(tmp_path / "state" / "missions")
        assert (tmp_path / "state" / "missions").is_dir()


def test_read_only_folder_is_refused() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o555)
        user = os.geteuid()
        os.seteuid(user or NOBODY)  # root may write everywhere
        try:
            for there in (folder, folder / "missions"):
                with pytest.raises(UserError, match="CODEBOTLER_HOME") as error:
                    make_folder(there)
                assert error.value.file == there
        finally:
            os.seteuid(user)
            folder.chmod(0o755)


def test_failed_folder_sync_is_an_error_only_if_the_disk_is_broken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    numbers = iter([errno.EINVAL, errno.EIO])

    def fail_to_sync(_descriptor: int) -> None:
        raise OSError(next(numbers), "refused")

    monkeypatch.setattr(os, "fsync", fail_to_sync)
    sync_folder(tmp_path)  # many file systems cannot sync a folder
    with pytest.raises(OSError, match=str(tmp_path)):
        sync_folder(tmp_path)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf_16_error_names_the_encoding(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    path.write_text('\ufeff{"a": 1}\n', encoding=encoding)
    for read in (read_text, lambda path: list(read_lines(path))):
        with pytest.raises(UserError, match="UTF-16") as error:
            read(path)
        assert error.value.file == path
