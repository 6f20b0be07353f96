"""The page of a report: whole in one file, quiet, and deaf to what models write."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from made_up_runs import HOSTILE, SUITE, cases, made_up
from roboeval.report.contents import Wishes, sections
from roboeval.report.page import page
from roboeval.report.reading import JudgedRun
from roboeval.report.writing import pieces, write_report


class Tags(HTMLParser):
    """Collects the tags, attributes and words of a page, and complains about what is not closed."""

    VOID = ("meta", "img", "source", "br", "input")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.words: list[str] = []
        self._open: list[str] = []
        self.feed(text)
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in self.VOID:
            self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def made(runs: list[JudgedRun], folder: Path) -> str:
    parts = sections(runs, SUITE, Wishes(published=True, command="roboeval report"))
    assert len([*write_report("a report", ["about it"], parts, folder)]) == pieces(parts)
    return (folder / "index.html").read_text()


@pytest.mark.parametrize("case", ["usual", "hostile", "one completion", "no failures", "all failures"])
def test_a_page_is_one_whole_file(case: str, tmp_path: Path) -> None:
    text = made(cases()[case], tmp_path)
    tags = Tags(text)
    assert tags.tags.count("script") == 1
    addresses = [value for name, value in tags.attributes if name in {"src", "href", "srcset"}]
    assert all(value and value.startswith(("#", "data:image/svg+xml;base64,")) for value in addresses)
    assert not re.search(r"https?://(?!www\.w3\.org)", text)
    targets = {value for name, value in tags.attributes if name == "id"}
    assert {value[1:] for value in addresses if value and value.startswith("#")} <= targets
    assert [name for name, _ in tags.attributes if name.startswith("on")] == []


def test_names_of_models_are_text(tmp_path: Path) -> None:
    text = made([made_up(HOSTILE, {"Visit": (4, 5)}), made_up("b", {"Visit": (1, 5)})], tmp_path)
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert(&#x27;x&#x27;)&lt;/script&gt;&amp;&quot;" in text
    assert "\x1b" not in text
    assert "\u202e" not in text
    assert Tags(text).tags.count("script") == 1


def test_only_the_script_of_the_page_may_run() -> None:
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', page("t", [], [], {}))
    assert policy is not None
    assert policy[1].startswith("default-src 'none'; ")
    assert re.search(r"script-src 'sha256-[\w+/]{43}='$", policy[1])


def test_every_number_of_the_page_is_in_a_csv(tmp_path: Path) -> None:
    text = made(cases()["usual"], tmp_path)
    named = set(re.findall(r"tables/([\w-]+\.csv)", text))
    assert named == {path.name for path in (tmp_path / "tables").iterdir()}
    drawn = {path.stem for path in (tmp_path / "figures").iterdir()}
    assert drawn == set(re.findall(r"figures/([\w-]+)\.pdf", text))


def test_the_same_runs_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        made(cases()["usual"], tmp_path / name)
    files = [path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*") if path.is_file()]
    assert len(files) > 15
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes(), file
