"""Read and write contracts as YAML."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.text.text_template import ANY_TEXT, TextTemplate
from codebotler.core.yaml_files import YamlFile
from codebotler.simulator.guard.contract import Contract, SkillBound, Templates, has_place

ANY, AT_MOST, IN = "any", "at most", "in"
WIDTH = 110  # characters of a line


class ContractFile(BaseModel):
    """The content of a contract file: what a program may pass to each skill."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    version: Literal[1]
    skills: Mapping[str, Mapping[str, Any]]


def read_contract(path: Path, skills: SkillTable = SKILLS) -> Contract:
    """Read a contract from a YAML file.

    Args:
        path: the file.
        skills: the skills that the contract may name.

    Raises:
        UserError: the file is not valid; the message gives the line and the fix.
    """
    return _contract_in(YamlFile.read(path), skills)


def contract_from(data: Mapping[str, Any], skills: SkillTable) -> Contract:
    """Make a contract from the value of `skills` in a contract file. Raise UserError if it is not valid."""
    text = json.dumps({"version": 1, "skills": data}, ensure_ascii=False)
    return _contract_in(YamlFile(text, "the contract"), skills)


def _contract_in(file: YamlFile, skills: SkillTable) -> Contract:
    content = file.validate(ContractFile)
    bounds = {}
    for name, given in content.skills.items():
        if name not in skills:
            sentence = f'there is no skill "{name}"; the skills are: {", ".join(skills)}'
            raise file.wrong(sentence, "skills", name)
        bounds[name] = _read_bound(file, skills[name], given)
    return Contract(bounds)


def _read_bound(file: YamlFile, row: Skill, given: Mapping[str, Any]) -> SkillBound:
    names = [parameter.name for parameter in row.parameters]
    known = [*names, AT_MOST, *([IN] if has_place(row) else [])]
    for key, value in given.items():
        where = "skills", row.name, key
        if key not in known:
            raise file.wrong(f'{row.name} has no key "{key}"; its keys are {", ".join(known)}', *where)
        is_list = isinstance(value, list) and all(isinstance(one, str) for one in value)
        if not (type(value) is int and value > 0 if key == AT_MOST else value == ANY or is_list):
            needed = "a whole number above 0" if key == AT_MOST else "any or a list of texts in quotes"
            raise file.wrong(f'"{key}" must be {needed}', *where)
    missing = [name for name in names if name not in given]
    if missing:
        sentence = f'{row.name} lacks the key "{missing[0]}"; write a list of texts, or any'
        raise file.wrong(sentence, "skills", row.name)
    texts = tuple((name, _templates(file, row, name, given[name])) for name in names)
    places = None if IN not in given or given[IN] == ANY else tuple(given[IN])
    return SkillBound(texts, places, given.get(AT_MOST))


def _templates(file: YamlFile, row: Skill, name: str, given: str | list[str]) -> Templates:
    if isinstance(given, str):
        return (ANY_TEXT,)
    found = []
    for number, text in enumerate(given):
        where = "skills", row.name, name, number
        try:
            found.append(TextTemplate.parse(text))
        except ValueError as error:
            raise file.wrong(str(error), *where) from None
        if found[-1].is_any and text.replace("{}", "").strip():
            raise file.wrong("the text is too long, so any text would be allowed; shorten it", *where)
    return tuple(found)


def contract_data(contract: Contract) -> dict[str, Any]:
    """Return a contract as dictionaries and lists, with the keys of a contract file."""
    return {"version": 1, "skills": {name: _bound_data(bound) for name, bound in contract.skills.items()}}


def _bound_data(bound: SkillBound) -> dict[str, Any]:
    data: dict[str, Any] = {
        name: ANY if ANY_TEXT in templates else [*map(str, templates)] for name, templates in bound.texts
    }
    if bound.places is not None:
        data[IN] = [*bound.places]
    return data if bound.at_most is None else data | {AT_MOST: bound.at_most}


def contract_yaml(contract: Contract) -> str:
    """Return a contract as the YAML text of a contract file."""
    return yaml.safe_dump(contract_data(contract), sort_keys=False, allow_unicode=True, width=WIDTH)
