"""Layouts of messages as dtypes of numpy."""

import json
from functools import cache

import numpy as np

from . import _native


@cache
def tables() -> dict:
    """The byte tables of all topics, by name."""
    return {table["topic"]: table for table in json.loads(_native.topics())}


@cache
def dtypes(topic: str) -> tuple[np.dtype, np.dtype]:
    """The dtypes of the header and of a row."""
    return dtypes_of(tables()[topic])


def dtypes_of(table: dict) -> tuple[np.dtype, np.dtype]:
    """The dtypes of the header and of a row of a byte table."""
    return _dtype(table["header"]), _dtype(table["row"])


def _dtype(fields: list[dict]) -> np.dtype:
    """A dtype with nested structs (``outer.inner``) and arrays of structs (``outer.0.inner``) from flat names."""
    groups: dict[str, list[dict]] = {}
    for field in fields:
        head, _, rest = field["name"].partition(".")
        groups.setdefault(head, []).append({**field, "name": rest})
    return np.dtype([(name, *_member(members)) for name, members in groups.items()]) if "" not in groups else _number(fields[0])


def _member(members: list[dict]) -> tuple:
    if members[0]["name"] == "":
        return (_number(members[0]),)
    indices = {member["name"].partition(".")[0] for member in members}
    if not all(index.isdigit() for index in indices):
        return (_dtype(members),)
    first = [member for member in members if member["name"].startswith("0.")]
    return _dtype([{**member, "name": member["name"][2:]} for member in first]), (len(indices),)


def _number(field: dict) -> np.dtype:
    kind = np.dtype("<" + field["kind"][0] + str(int(field["kind"][1:]) // 8))
    return kind if field["count"] == 1 else np.dtype((kind, (field["count"],)))
