"""Suites of installed packages: found without importing them, and refused if names clash."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from command_line import ENVIRONMENT, roboeval
from roboeval.suites.load import installed_suites, load_suite
from roboeval.suites.new_task import new_task
from roboeval.web.run_store import RunStore

Install = Callable[..., Path]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Return a function that puts a package with a suite on the path, with the metadata of an installer."""
    site = tmp_path / "site"
    site.mkdir()
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.chdir(tmp_path)

    def write(
        package: str = "garden-suite",
        name: str = "garden",
        *,
        point: str | None = None,
        place: str | None = None,
        whole: bool = True,
    ) -> Path:
        module = package.replace("-", "_")
        folder = site / module
        folder.mkdir()
        (folder / "__init__.py").write_text("raise RuntimeError('nobody runs me')\n")
        if whole:
            new_task(folder, "WaterPlants")
            text = (folder / "suite.yaml").read_text()
            (folder / "suite.yaml").write_text(
                text.replace(f"name: {folder.name.replace('_', '-')}", f"name: {name}")
            )
        info = site / f"{module}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[roboeval.suites]\n{point or name} = {place or module}\n")
        return folder

    return write


def test_a_suite_is_found_by_its_name_without_running_its_package(install: Install) -> None:
    folder = install()
    assert load_suite("garden").folder == folder
    assert installed_suites().names == {"garden"}
    ended = roboeval("tasks", "--lint", "--suite", "garden", environment=ENVIRONMENT | dict(os.environ))
    assert (ended.status, ended.out) == (0, "no findings\n"), ended
    listed = roboeval("tasks", environment=ENVIRONMENT | dict(os.environ))
    assert "garden" in listed.err


def test_a_suite_may_be_in_a_subfolder_of_its_package(install: Install) -> None:
    folder = install(place="garden_suite.suites.roses")
    (folder / "suites").mkdir()
    for one in ("suite.yaml", "tasks", "solutions"):
        (folder / "suites" / "roses").mkdir(exist_ok=True)
        (folder / one).rename(folder / "suites" / "roses" / one)
    assert list(load_suite("garden").tasks) == ["WaterPlants"]


def test_pages_find_installed_suites_and_warn_of_broken_ones(
    install: Install, capsys: pytest.CaptureFixture[str]
) -> None:
    install()
    install("broken-suite", "broken", whole=False)
    store = RunStore(Path("runs"))
    assert [store.suite(name) is not None for name in ("paper", "garden", "broken", "none")] == [
        True,
        True,
        False,
        False,
    ]
    warning = capsys.readouterr().err
    assert "broken_suite" in warning
    assert '"broken"' in warning


def test_two_packages_with_the_same_suite_name_are_refused(install: Install) -> None:
    install()
    install("other-suite")
    with pytest.raises(UserError, match='"garden": garden_suite and other_suite;'):
        load_suite("garden")


def test_a_folder_with_the_name_of_an_installed_suite_is_refused(install: Install) -> None:
    install()
    new_task(Path("garden"), "WaterPlants")
    with pytest.raises(UserError, match=r"garden_suite and \./garden;"):
        load_suite("garden")
    assert load_suite("./garden").folder == Path("garden").resolve()


def test_a_package_cannot_take_the_name_of_a_shipped_suite(install: Install) -> None:
    folder = install(name="paper")
    assert load_suite("paper").folder != folder


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"whole": False}, r'"garden" has no suite\.yaml in garden_suite;'),
        ({"place": "gone"}, r'"garden" .*in gone;'),
        ({"place": "garden_suite:SUITE"}, r'"garden" .*in garden_suite:SUITE;'),
        ({"point": "roses", "name": "garden"}, r'line 1: .*"garden", .*"roses"'),
    ],
)
def test_a_broken_package_is_refused(install: Install, changed: dict[str, str], named: str) -> None:
    install(**changed)
    asked = changed.get("point", "garden")
    with pytest.raises(UserError, match=named):
        load_suite(asked)
    ended = roboeval("tasks", "--suite", asked, environment=ENVIRONMENT | dict(os.environ))
    assert (ended.status, ended.err.count("\n"), "Traceback" in ended.err) == (2, 1, False)


def test_new_tasks_in_installed_and_shipped_suites_are_refused(install: Install) -> None:
    install()
    for suite in ("garden", "plus"):
        ended = roboeval(
            "tasks", "--new", "MakeTea", "--suite", suite, environment=ENVIRONMENT | dict(os.environ)
        )
        assert (ended.status, "cannot be changed" in ended.err) == (2, True)
        assert not Path(suite).exists()
