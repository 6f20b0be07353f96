"""docs/architecture.md lists each module with what its docstring says it is."""

import runpy
from pathlib import Path

WEBSITE = Path(__file__).parent.parent / "website"


def test_all_modules_are_listed_as_they_describe_themselves() -> None:
    modules = runpy.run_path(str(WEBSITE / "modules.py"))
    assert modules["PAGE"].read_text() == modules["page"](), (
        "`python website/modules.py` writes the list anew"
    )
