"""The page of a report: one whole file, without outside resources, that escapes what models write."""

import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from made_up_runs import HOSTILE, UNCHECKED, cases, new_run
from roboeval.report.page import page
from roboeval.report.runs import JudgedRun
from roboeval.report.sheets import Prose, ReportFigure, Section, format_cell, sheet
from roboeval.report.writing import count_parts, expect_no_others, sections, write_report


class Tags(HTMLParser):
    """Collect the tags, attributes and words of a page, and check that all tags are closed."""

    VOID = ("meta", "img", "source", "br", "input", "wbr")

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


def parts(runs: list[JudgedRun]) -> list[Section]:
    return sections(runs, with_published=True, command="roboeval report")


def page_of(runs: list[JudgedRun]) -> str:
    """Return the page, with a dot for each figure, because figures have their own tests."""
    dot = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
    names = [part.name for section in parts(runs) for part in section.parts if isinstance(part, ReportFigure)]
    return page("a report", ["about it"], parts(runs), dict.fromkeys(names, dot))


def write_whole_report(folder: Path) -> Path:
    found = parts(cases()["usual"])
    assert len([*write_report("a report", ["about it"], found, folder)]) == count_parts(found)
    return folder


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a report with all its figures, and return its folder."""
    return write_whole_report(tmp_path_factory.mktemp("usual"))


@pytest.mark.parametrize("case", ["usual", "hostile", "one completion", "no failures", "all failures"])
def test_a_page_is_one_whole_file(case: str, usual: Path) -> None:
    text = (usual / "index.html").read_text() if case == "usual" else page_of(cases()[case])
    tags = Tags(text)
    assert tags.tags.count("script") == 1
    addresses = [value for name, value in tags.attributes if name in {"src", "href", "srcset"}]
    files = {value for value in addresses if value and re.fullmatch(r"tables/[\w-]+\.csv", value)}
    inside = ("#", "data:image/svg+xml;base64,")
    assert all(value in files or (value and value.startswith(inside)) for value in addresses)
    assert not re.search(r"https?://(?!www\.w3\.org)", text)
    targets = {value for name, value in tags.attributes if name == "id"}
    assert {value[1:] for value in addresses if value and value.startswith("#")} <= targets
    assert [name for name, _ in tags.attributes if name.startswith("on")] == []


def test_the_first_screen_names_the_best_run_and_the_commonest_failure() -> None:
    runs = [
        new_run("weak", {"Visit": (3, 3), "Wait": (3, 3)}),
        new_run("strong", {"Visit": (10, 10), "Wait": (10, 10)}),
    ]
    glance = sections(runs)[0]
    assert glance.name == "glance"
    text = page_of(runs)
    first = text[text.index('<section id="glance"') : text.index('<section id="results"')]
    assert first.count('<article class="card">') == 2
    assert "<b>0.300</b> pass@1" in first
    assert re.search(r"Most frequent failure: \w+ \([\w ]+\), \d+% of all completions\.", first)
    assert "Every program passes." in first
    assert re.search(r"<p>strong (is better|passes more often) than weak by 70\.0 points", first)
    assert '<a href="tables/overall.csv">tables/overall.csv</a>' in text


def test_small_p_values_are_shown_as_below_a_bound() -> None:
    assert [format_cell(p, "p") for p in (0.00002, 0.001, 0.25, None)] == ["< 0.001", "0.001", "0.250", "-"]


def test_a_card_says_why_an_interval_is_unknown() -> None:
    text = page_of([new_run("a", {"Visit": (5, 5), "CountMugs": (5,)})])
    assert "95% interval over tasks unknown: no variation between tasks" in text
    assert "95% interval over tasks unknown: too few tasks" in page_of([new_run("a", {"Visit": (5, 4)})])


def test_a_card_shows_counts_and_cut_off_replies() -> None:
    cut = new_run(
        "cut",
        {"Visit": (5, 4), "CountMugs": (3,)},
        written=lambda _, index: {"finish_reason": "length" if index < 2 else "stop"},
        about={"settings": {"max_tokens": 64}},
    )
    text = card(cut)
    assert "30 of 30 completions, 3 prompts of 2 tasks" in text
    assert re.search(r'class="warning">6 of 30 replies \(20\.0%\) .*64 tokens; .*--max-tokens', text)
    lacking = replace(cut, results=replace(cut.results, about=REQUESTED))
    assert "30 of 36 completions (6 missing)" in card(lacking)
    assert 'class="warning"' not in card(new_run("whole", {"Visit": (5,)}))


REQUESTED = {"batches": [{"tasks": ["Visit", "CountMugs"], "num_completions": 9}]}


def card(run: JudgedRun) -> str:
    text = page_of([run])
    return text[text.index('<article class="card">') : text.index("</article>")]


def test_caption_says_how_many_tasks_each_run_has() -> None:
    text = page_of([new_run("a", {"Visit": (5, 5)}), new_run("b", {"Visit": (5,), "CountMugs": (5,)})])
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", text)
    assert re.search(r"\ba: 20 of 20 completions, 2 prompts of 1 task\. b: .* of 2 tasks\.", captions[0])
    assert text.index('id="figure-overall"') < text.index('id="figure-tasks"')


def test_empty_columns_are_omitted_and_long_tables_are_cut(usual: Path) -> None:
    text = page(
        "t", [], [Section("origin", [sheet("phrasings", [["Visit", 0, 0.1, None, None, "x"]] * 1_001)])], {}
    )
    assert "<thead><tr>" in text
    assert ">hurts<" not in text
    assert text.count("<tr>") == 1 + 1_000
    assert "1 more row in the CSV file." in text
    budget = (usual / "tables" / "budget.csv").read_text().splitlines()[0]
    assert "passes per unit of money" in budget
    assert ">passes per unit of money<" not in (usual / "index.html").read_text()


def test_commands_in_sentences_are_code() -> None:
    text = page("t", [], [Section("origin", [Prose(["`a <b>` shows it"])])], {})
    assert "<p><code>a &lt;b&gt;</code> shows it</p>" in text


def test_one_prompt_is_written_in_the_singular(usual: Path) -> None:
    text = (usual / "index.html").read_text()
    assert re.search(r"<p>Prompt \d+\. Example:", text)
    assert not re.search(r"<p>Prompts \d+\.", text)


def test_names_of_models_are_text() -> None:
    text = page_of([new_run(HOSTILE, {"Visit": (4, 5)}), new_run("b", {"Visit": (1, 5)})])
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert(&#x27;x&#x27;)&lt;/script&gt;&amp;&quot;" in text
    assert "\x1b" not in text
    assert "\u202e" not in text
    assert Tags(text).tags.count("script") == 1


def test_classes_of_failures_have_readable_names(usual: Path) -> None:
    text = (usual / "index.html").read_text()
    assert {"Python error", "robot error", "failed check"} <= set(Tags(text).words)
    assert re.search('data-kind="failed check: SayAtLocation"', text)
    assert not re.search("PythonError|RobotExecutionError|TaskCompletionError", text.replace("<wbr>", ""))
    table = (usual / "tables" / "causes.csv").read_text()
    assert all(name in table for name in ("PythonError", "RobotExecutionError", "TaskCompletionError"))


def test_long_names_may_be_broken(usual: Path) -> None:
    assert "Go<wbr>To<wbr>Invalid<wbr>Location" in (usual / "index.html").read_text()


def test_only_the_script_of_the_page_may_run() -> None:
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', page("t", [], [], {}))
    assert policy is not None
    assert policy[1].startswith("default-src 'none'; ")
    assert re.search(r"script-src 'sha256-[\w+/]{43}='$", policy[1])


def test_the_page_links_each_table_and_figure(usual: Path) -> None:
    text = (usual / "index.html").read_text()
    named = set(re.findall(r"tables/([\w-]+\.csv)", text))
    assert named == {path.name for path in (usual / "tables").iterdir()}
    drawn = {path.stem for path in (usual / "figures").iterdir()}
    assert drawn == set(re.findall(r"figures/([\w-]+)\.pdf", text))


@pytest.mark.slow
def test_the_same_runs_give_the_same_bytes(usual: Path, tmp_path: Path) -> None:
    again = write_whole_report(tmp_path)
    files = [path.relative_to(usual) for path in usual.rglob("*") if path.is_file()]
    assert len(files) > 15
    for file in files:
        assert (usual / file).read_bytes() == (again / file).read_bytes(), file


@pytest.mark.slow
def test_an_interrupted_report_says_that_it_is_not_finished(tmp_path: Path) -> None:
    piece = next(write_report("a report", ["about it"], parts([new_run("a", {"Visit": (10,)})]), tmp_path))
    assert piece in {path.stem for path in tmp_path.glob("*/*")}
    assert "This report is not finished" in (tmp_path / "index.html").read_text()
    expect_no_others(tmp_path)


def test_files_of_an_earlier_report_are_removed(usual: Path, tmp_path: Path) -> None:
    shutil.copytree(usual, tmp_path, dirs_exist_ok=True)
    (tmp_path / "tables" / "mine.csv").write_text("kept")
    run = new_run("a", {"Visit": (10,)}, accepted=UNCHECKED)
    found = [section for section in parts([run]) if section.name not in {"results", "thresholds", "causes"}]
    list(write_report("another", [], found, tmp_path))
    named = set(re.findall(r"tables/([\w-]+)\.csv", (tmp_path / "index.html").read_text()))
    there = {path.stem for path in tmp_path.glob("*/*")}
    assert there == named | {"mine"}
    assert "rejection-sampling" not in there
    assert (tmp_path / "tables" / "mine.csv").read_text() == "kept"
