"""The public names are typed, documented and cheap to import, and the page's examples run."""

import ast
import inspect
import json
import os
import re
import runpy
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import codebotler
import roboeval
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill
from codebotler.core.skills.values import NO_VALUE
from roboeval import Suite, load_suite

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGE = (DOCS / "library.md").read_text()
EXAMPLES = re.findall(r"^```python\n(.*?)^```\n\n```text\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
PACKAGES = {"codebotler": codebotler.__all__, "roboeval": roboeval.__all__}
NAMES = [(package, name) for package, names in PACKAGES.items() for name in names]
WEB = {"nicegui", "fastapi", "starlette", "uvicorn", "websockets"}
MODELS = {"pydantic_ai", "openai", "anthropic", "google.genai", "httpx", "torch", "transformers"}
FIGURES = {"matplotlib", "numpy", "polars", "PIL"}
DRAWING = {"rich"}
WORK = {"yaml", "asyncio"}


def imported_by(code: str) -> set[str]:
    script = f"{code}\nimport json, sys\nprint('\\n' + json.dumps(sorted(sys.modules)))"
    command = [sys.executable, "-c", script]
    ended = subprocess.run(command, capture_output=True, text=True, check=True)
    return {*json.loads(ended.stdout.splitlines()[-1])}


def test_imported_by_finds_a_library() -> None:
    assert "numpy" in imported_by("import numpy")


@pytest.mark.parametrize("package", PACKAGES)
def test_importing_a_package_imports_next_to_nothing(package: str) -> None:
    new = imported_by(f"import {package}") - imported_by("")
    assert new <= {package, "codebotler", "codebotler.core", "codebotler.core.facade", "__future__"}


@pytest.mark.slow
def test_using_the_names_imports_no_library_for_pages_figures_or_models() -> None:
    code = "\n".join(  # load_results is left out: its table needs polars.
        f"from {package} import {', '.join(name for name in names if name != 'load_results')}"
        for package, names in PACKAGES.items()
    )
    assert not imported_by(code) & (WEB | MODELS | FIGURES | DRAWING)


CALL_SCRIPT = """
import importlib, json, sys
imported = []
for package, arguments in {calls}:
    sys.argv = ["x", *arguments]
    try:
        importlib.import_module(f"{{package}}.__main__").main()
    except SystemExit:
        pass
    imported.append(sorted(sys.modules))
print("\\n" + json.dumps(imported))
"""


def test_help_imports_no_library_that_commands_need() -> None:
    words: list[list[str]] = [["--help"], ["--version"], [], ["run", "--help"], ["serve", "--help"]]
    calls = [(package, arguments) for arguments in words for package in PACKAGES]
    command = [sys.executable, "-c", CALL_SCRIPT.format(calls=calls)]
    ended = subprocess.run(command, capture_output=True, text=True, check=True)
    for call, names in zip(calls, json.loads(ended.stdout.splitlines()[-1]), strict=True):
        assert "typer" in names
        assert not {*names} & (WEB | MODELS | FIGURES | DRAWING | WORK), call
        if call[1] == ["--help"]:  # For other calls typer imports pydantic.
            assert "pydantic" not in names


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_is_run_as_its_command(package: str) -> None:
    words = [sys.executable, "-m", package, "--version"]
    ended = subprocess.run(words, capture_output=True, text=True, check=True)
    assert ended.stdout == f"{package} {import_module(package).__version__}\n"


@pytest.mark.parametrize("package", PACKAGES)
def test_python_without_docstrings_is_refused_in_a_sentence(package: str) -> None:
    words = [sys.executable, "-OO", "-m", package, "--version"]
    ended = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (2, "", 1)
    assert "-OO" in ended.stderr


@pytest.mark.parametrize(("package", "name"), NAMES)
def test_a_public_name_is_documented_and_is_no_module(package: str, name: str) -> None:
    """A module of the same name would replace it as soon as the module is imported."""
    found = getattr(import_module(package), name)
    assert name == "__version__" or found.__doc__
    assert find_spec(f"{package}.{name}") is None
    assert name in dir(import_module(package))


def test_imported_modules_do_not_replace_functions_of_their_name() -> None:
    for module in ("evaluation.judging.judge", "cli.app"):
        import_module(f"roboeval.{module}")
    for module in ("checking.check", "generation.generate", "cli.app"):
        import_module(f"codebotler.{module}")
    assert callable(roboeval.evaluate)
    assert callable(codebotler.check)
    assert callable(codebotler.generate)


@pytest.mark.parametrize("package", PACKAGES)
def test_missing_name_raises_attribute_error(package: str) -> None:
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'evalute'"):
        _ = import_module(package).evalute
    assert not hasattr(import_module(package), "pages")


@pytest.mark.parametrize("package", PACKAGES)
def test_the_page_lists_the_public_names(package: str) -> None:
    table = re.search(rf"^\| from `{package}` \|.*?\n\n", PAGE + "\n", re.DOTALL | re.MULTILINE)
    assert table is not None
    firsts = re.findall(r"^\| (`.*?) \|", table[0], re.MULTILINE)
    assert sorted(re.findall(r"`(\w+)`", " ".join(firsts))) == sorted(PACKAGES[package])


@pytest.fixture(scope="module")
def documented_modules() -> set[str]:
    """Return the modules on the reference pages of the site."""
    build = runpy.run_path(str(ROOT / "website" / "build.py"))
    return {module for modules in build["MODULES"].values() for module in modules}


def imports(code: str) -> Iterator[tuple[str, str]]:
    """Yield each of our modules that code imports, and the name from it; "" for the module itself."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if alias.name.split(".")[0] in PACKAGES)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in PACKAGES:
            yield from ((node.module or "", alias.name) for alias in node.names)


def published_code() -> Iterator[tuple[str, str]]:
    """Yield the name of each page and example, and code on it that a reader may copy."""
    for page in (ROOT / "README.md", *sorted(DOCS.glob("*.md"))):
        text = page.read_text()
        for session in re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
            lines = re.findall(r"^(?:>>>|\.\.\.) ?(.*)$", session, re.MULTILINE)
            yield page.name, "\n".join(lines) if session.startswith(">>> ") else session
    for example in sorted((ROOT / "examples").glob("*.py")):
        yield example.name, example.read_text()


def test_pages_and_examples_import_what_is_public_or_documented(documented_modules: set[str]) -> None:
    found = [(place, *one) for place, code in published_code() for one in imports(code)]
    assert {"robots.md", "rtl.md", "judge_a_program.py"} <= {one[0] for one in found}
    for place, module, name in found:
        assert module in documented_modules, (place, module)
        assert module not in PACKAGES or name in PACKAGES[module], (place, name)


def test_the_page_lists_the_documented_modules(documented_modules: set[str]) -> None:
    _, _, table = PAGE.partition("\n| documented module |")
    firsts = re.findall(r"^\| (`.*?) \|", table.partition("\n\n")[0], re.MULTILINE)
    listed = re.findall(r"`([\w.]+)`", " ".join(firsts))
    assert sorted(listed) == sorted(documented_modules - set(PACKAGES))
    assert all(import_module(module).__doc__ for module in documented_modules)


@cache
def cached_suite(name: str) -> Suite:
    return load_suite(name)


@pytest.mark.parametrize(
    "suite", ["paper", "plus", pytest.param("plus` with `worlds=5", marks=pytest.mark.slow)]
)
def test_page_gives_numbers_of_worlds(suite: str) -> None:
    name, _, count = suite.partition("` with `worlds=")
    loaded = cached_suite(name).with_worlds(int(count)) if count else cached_suite(name)
    numbers = [len(task.scenarios) for task in loaded.tasks.values()]
    assert f"\n| `{suite}` | {min(numbers)} to {max(numbers)} | " in PAGE


@pytest.mark.parametrize(
    ("code", "printed"),
    [
        pytest.param(*example, marks=[pytest.mark.slow] * ("recorded_completions" in example[0]))
        for example in EXAMPLES
    ],
)
def test_an_example_prints_what_the_page_shows(
    code: str, printed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len(ast.parse(code).body) == 3
    exec(code, {})
    assert capsys.readouterr().out == printed


def test_all_four_examples_are_there() -> None:
    assert len(EXAMPLES) == 4


@pytest.mark.parametrize(("package", "name"), NAMES)
def test_signatures_are_short(package: str, name: str) -> None:
    found = getattr(import_module(package), name)
    if inspect.isfunction(found):
        assert len(str(inspect.signature(found))) < 600


LONG = "def task_program():\n" + "    say('hello', 1)\n    say(x)\n" * 500


def large_results() -> Iterator[object]:
    """Yield large results of public functions, and their parts."""
    for suite in (cached_suite("paper"), cached_suite("plus")):
        yield suite
        for task in suite.tasks.values():
            yield task
            for scenario in task.scenarios:
                yield from (scenario, scenario.world, *scenario.require)
    yield from roboeval.recorded_completions("recorded:careful", cached_suite("paper"))
    yield codebotler.program_of(LONG)
    for check in (codebotler.check(LONG), codebotler.check(LONG.replace(", 1)", ")").replace("say(x)", ""))):
        yield from (check, check.room_map, *check.samples, *(sample.outcome for sample in check.samples))
    generation = codebotler.generate(cached_suite("paper").tasks["SayGoodDay"].prompts[0])
    (attempt,) = generation.attempts
    yield from (generation, attempt, attempt.prompt, attempt.reply)


def test_results_have_short_representations() -> None:
    found = [*large_results()]
    kinds = {type(one).__name__ for one in found}
    assert {"Suite", "Task", "World", "CheckResult", "Outcome", "Reply"} <= kinds
    assert [repr(one) for one in found if len(repr(one)) > 400] == []
    assert {
        "Suite('plus', 16 tasks)",
        "Task('LunchTime', 5 prompts, 2 worlds)",
        "Scenario(World(3 rooms, robot='start_loc'), 5 requirements)",
        "Program(1,001 lines)",
        "CheckResult(1,000 problems, 5 samples)",
        "Generation(1 attempt, 0 problems)",
    } <= {repr(one) for one in found}


NOTEBOOK = """
import asyncio
from codebotler import UserError, generate
async def cell():
    return generate(INSTRUCTION, rooms=["kitchen", "jill's office", "start_loc"])
assert asyncio.run(cell()).program == generate(INSTRUCTION).program
for wrong in ({"retries": -1}, {"model": "nobody"}):
    try:
        generate(INSTRUCTION, **wrong)
    except UserError as error:
        print(error)
"""


def test_rooms_as_a_single_string_are_refused() -> None:
    for call in (
        lambda: codebotler.check("def task_program():\n    go_to('kitchen')\n", rooms="kitchen"),
        lambda: codebotler.generate("Go to the kitchen.", rooms="kitchen"),
        lambda: codebotler.prompt_for("Go to the kitchen.", rooms="kitchen"),
    ):
        with pytest.raises(codebotler.UserError, match=r"rooms .* list"):
            call()


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"samples": 0}, "samples must be from 1 to .*, not 0$"),
        ({"samples": 10**9}, "samples must be .* 10,000, not 1,000,000,000$"),
        (
            {"skills": SKILLS.with_skill(Skill("fly", (), NO_VALUE, "Fly."))},
            '"fly" cannot be simulated because it has no code',
        ),
    ],
)
def test_check_refuses_invalid_arguments(wrong: dict[str, Any], named: str) -> None:
    with pytest.raises(codebotler.UserError, match=named):
        codebotler.check("def task_program():\n    say('hello')\n", **wrong)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"max_tokens": 0}, "token limit is 0; .* 1$"),
        ({"temperature": -1}, "temperature is -1; .* 0 "),
        ({"top_p": 2}, "top-p is 2; .* 1$"),
        ({"timeout": 0}, "timeout is 0 "),
    ],
)
def test_settings_out_of_range_are_refused(wrong: dict[str, Any], named: str) -> None:
    with pytest.raises(codebotler.UserError, match=named):
        codebotler.SamplingSettings(**wrong)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"task": 3}, "task is 3, .*string"),
        ({"prompt": "0"}, "prompt is '0', .*whole number"),
        ({"index": -1}, "index is -1, .* whole number"),
        ({"index": 10**9}, "index is 1000000000, .* 999,999,999$"),
        ({"program": None}, "program is None, .*string"),
        ({"instruction": 1}, "instruction is 1, .*string"),
        ({"model": 1}, "model is 1, .*string"),
    ],
)
def test_completion_refuses_invalid_fields(wrong: dict[str, Any], named: str) -> None:
    right: dict[str, Any] = {"task": "LunchTime", "prompt": 0, "index": 0, "program": ""}
    with pytest.raises(codebotler.UserError, match=named):
        roboeval.Completion(**(right | wrong))


USES = """
from roboeval import Completion, Row, evaluate, load_suite
def count(rows: list[Row]) -> int:
    return sum(row["passed"] for row in rows)
completion = Completion(task="LunchTime", prompt=0, index=0, program="")
print(count([*evaluate([completion], load_suite())]))
"""


MISTAKES = {
    "reads": ('row["passed"]', 'row["pased"]', 'TypedDict "Row" has no key "pased"'),
    "gives": ("prompt=0", "prompt='0'", 'incompatible type "str"; expected "int"'),
    "names": (", program=", ", text=", 'Unexpected keyword argument "text"'),
}


@pytest.mark.slow
def test_type_checker_finds_mistakes_and_nothing_else(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    (tmp_path / "uses.py").write_text(USES)
    for name, (right, wrong, _) in MISTAKES.items():
        (tmp_path / f"{name}.py").write_text(USES.replace(right, wrong))
    files = ["uses.py", *(f"{name}.py" for name in MISTAKES)]
    words = [sys.executable, "-m", "mypy", "--strict", "--follow-imports", "silent", *files]
    env = {**os.environ, "MYPYPATH": str(ROOT / "src")}
    ended = subprocess.run(words, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    lines = ended.stdout.splitlines()
    for name, (_, _, found) in MISTAKES.items():
        assert any(line.startswith(f"{name}.py:") and found in line for line in lines), ended
    assert not any(line.startswith("uses.py:") for line in lines), ended
    assert lines[-1].endswith("(checked 4 source files)")


def test_missing_file_of_completions_is_refused() -> None:
    with pytest.raises(codebotler.UserError, match="No such file") as error:
        next(roboeval.read_completions("x.jsonl"))
    assert str(error.value.file) == "x.jsonl"


def test_folder_without_a_suite_is_refused(tmp_path: Path) -> None:
    with pytest.raises(codebotler.UserError, match=f'"{tmp_path}"'):
        roboeval.load_suite(tmp_path)


def test_generate_works_in_a_notebook_and_refuses_invalid_arguments(
    paper: Suite, capsys: pytest.CaptureFixture[str]
) -> None:
    exec(NOTEBOOK, {"INSTRUCTION": paper.tasks["LunchTime"].prompts[0]})
    retries, model = capsys.readouterr().out.splitlines()
    assert re.search("retries is -1; .* 0$", retries)
    assert '"nobody"' in model
