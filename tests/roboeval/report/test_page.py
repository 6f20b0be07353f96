"""The page of a report: whole in one file, quiet, and deaf to what models write."""

import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from made_up_runs import HOSTILE, UNCHECKED, cases, made_up
from roboeval.report.page import page
from roboeval.report.runs import JudgedRun
from roboeval.report.sheets import Prose, ReportFigure, Section, format_cell, sheet
from roboeval.report.writing import expect_no_others, pieces, sections, write_report


class Tags(HTMLParser):
    """Collects the tags, attributes and words of a page, and complains about what is not closed."""

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


def shown(runs: list[JudgedRun]) -> str:
    """The page, with a dot for each figure: what figures look like is not asked here."""
    dot = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
    names = [part.name for section in parts(runs) for part in section.parts if isinstance(part, ReportFigure)]
    return page("a report", ["about it"], parts(runs), dict.fromkeys(names, dot))


def written(folder: Path) -> Path:
    found = parts(cases()["usual"])
    assert len([*write_report("a report", ["about it"], found, folder)]) == pieces(found)
    return folder


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a report with all its figures."""
    return written(tmp_path_factory.mktemp("usual"))


@pytest.mark.parametrize("case", ["usual", "hostile", "one completion", "no failures", "all failures"])
def test_a_page_is_one_whole_file(case: str, usual: Path) -> None:
    text = (usual / "index.html").read_text() if case == "usual" else shown(cases()[case])
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


def test_the_first_screen_says_who_is_ahead_and_what_fails_most() -> None:
    runs = [
        made_up("weak", {"Visit": (3, 3), "Wait": (3, 3)}),
        made_up("strong", {"Visit": (10, 10), "Wait": (10, 10)}),
    ]
    glance = sections(runs)[0]
    assert glance.name == "glance"
    text = shown(runs)
    first = text[text.index('<section id="glance"') : text.index('<section id="results"')]
    assert first.count('<article class="card">') == 2
    assert "<b>0.300</b> pass@1" in first
    assert re.search(r"Most frequent failure: \w+ \([\w ]+\), \d+% of all completions\.", first)
    assert "Every program passes." in first
    assert re.search(r"<p>strong (is better|passes more often) than weak by 70\.0 points", first)
    assert '<a href="tables/overall.csv">tables/overall.csv</a>' in text


def test_a_p_that_is_nothing_is_said_to_be_small() -> None:
    assert [format_cell(p, "p") for p in (0.00002, 0.001, 0.25, None)] == ["< 0.001", "0.001", "0.250", "-"]


def test_a_card_says_where_an_interval_is_unknown() -> None:
    text = shown([made_up("a", {"Visit": (5, 5), "CountMugs": (5,)})])
    assert "95% interval over tasks unknown: no variation between tasks" in text
    assert "95% interval over tasks unknown: too few tasks" in shown([made_up("a", {"Visit": (5, 4)})])


def test_a_card_says_of_how_many_completions_and_whether_replies_were_cut_off() -> None:
    cut = made_up(
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
    assert 'class="warning"' not in card(made_up("whole", {"Visit": (5,)}))


REQUESTED = {"batches": [{"tasks": ["Visit", "CountMugs"], "num_completions": 9}]}


def card(run: JudgedRun) -> str:
    text = shown([run])
    return text[text.index('<article class="card">') : text.index("</article>")]


def test_caption_says_how_many_tasks_each_run_has() -> None:
    text = shown([made_up("a", {"Visit": (5, 5)}), made_up("b", {"Visit": (5,), "CountMugs": (5,)})])
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", text)
    assert re.search(r"\ba: 20 of 20 completions, 2 prompts of 1 task\. b: .* of 2 tasks\.", captions[0])
    assert text.index('id="figure-overall"') < text.index('id="figure-tasks"')


def test_empty_columns_are_left_out_and_long_tables_are_cut(usual: Path) -> None:
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


def test_one_prompt_is_one(usual: Path) -> None:
    text = (usual / "index.html").read_text()
    assert re.search(r"<p>Prompt \d+\. Example:", text)
    assert not re.search(r"<p>Prompts \d+\.", text)


def test_names_of_models_are_text() -> None:
    text = shown([made_up(HOSTILE, {"Visit": (4, 5)}), made_up("b", {"Visit": (1, 5)})])
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert(&#x27;x&#x27;)&lt;/script&gt;&amp;&quot;" in text
    assert "\x1b" not in text
    assert "\u202e" not in text
    assert Tags(text).tags.count("script") == 1


def test_classes_of_failures_are_called_what_people_call_them(usual: Path) -> None:
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


def test_every_number_of_the_page_is_in_a_csv(usual: Path) -> None:
    text = (usual / "index.html").read_text()
    named = set(re.findall(r"tables/([\w-]+\.csv)", text))
    assert named == {path.name for path in (usual / "tables").iterdir()}
    drawn = {path.stem for path in (usual / "figures").iterdir()}
    assert drawn == set(re.findall(r"figures/([\w-]+)\.pdf", text))


@pytest.mark.slow
def test_the_same_runs_give_the_same_bytes(usual: Path, tmp_path: Path) -> None:
    again = written(tmp_path)
    files = [path.relative_to(usual) for path in usual.rglob("*") if path.is_file()]
    assert len(files) > 15
    for file in files:
        assert (usual / file).read_bytes() == (again / file).read_bytes(), file


@pytest.mark.slow
def test_a_report_that_was_interrupted_is_one_and_says_so(tmp_path: Path) -> None:
    piece = next(write_report("a report", ["about it"], parts([made_up("a", {"Visit": (10,)})]), tmp_path))
    assert piece in {path.stem for path in tmp_path.glob("*/*")}
    assert "This report is not finished" in (tmp_path / "index.html").read_text()
    expect_no_others(tmp_path)


def test_what_an_earlier_report_had_more_is_gone(usual: Path, tmp_path: Path) -> None:
    shutil.copytree(usual, tmp_path, dirs_exist_ok=True)
    (tmp_path / "tables" / "mine.csv").write_text("kept")
    run = made_up("a", {"Visit": (10,)}, accepted=UNCHECKED)
    found = [section for section in parts([run]) if section.name not in {"results", "thresholds", "causes"}]
    list(write_report("another", [], found, tmp_path))
    named = set(re.findall(r"tables/([\w-]+)\.csv", (tmp_path / "index.html").read_text()))
    there = {path.stem for path in tmp_path.glob("*/*")}
    assert there == named | {"mine"}
    assert "rejection-sampling" not in there
    assert (tmp_path / "tables" / "mine.csv").read_text() == "kept"
