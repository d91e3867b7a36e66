"""The columns of submaps: the meaning of each number of a point."""

import json
from dataclasses import dataclass, fields

from . import _native


@dataclass(frozen=True)
class Field:
    """One number of every point."""

    #: Name in LAS records, pictures and the viewer.
    name: str
    #: Name of the property in PLY clouds.
    property: str
    #: Name of the field in the rows of the topic; empty if the rows are plain numbers.
    row_field: str
    #: ``coordinate``, ``f64``, ``f32``, ``u32``, ``u8``, or ``share``: 0 to 255 on the topic, 0 to 1 in clouds.
    kind: str
    #: Unit; empty without a unit.
    unit: str
    #: Value that marks points without a value; ``None``: every point has a value.
    none: float | None
    #: What it is.
    description: str


@dataclass(frozen=True)
class Column:
    """Fields that are present together, and their topic."""

    name: str
    topic: str
    #: What it is.
    description: str
    fields: tuple[Field, ...]


def columns_from_json(text: str) -> tuple[Column, ...]:
    """The columns of a table that Rust has written."""

    def field(values: dict) -> Field:
        return Field(**{key.name: values[key.name] for key in fields(Field)})

    def column(values: dict) -> Column:
        members = tuple(field(member) for member in values["fields"])
        return Column(values["name"], values["topic"], values["description"], members)

    return tuple(column(values) for values in json.loads(text))


#: All columns of the pipeline.
COLUMNS = columns_from_json(_native.columns())
