"""Joins each submap with its columns, which may arrive in later ticks."""

import pickle
from collections.abc import Iterator

import numpy as np

from ._layouts import dtypes
from ._messages import Inputs, Message


class SubmapJoin:
    """Submaps that wait for columns, and columns that wait for their submap. For offline runs, where all arrive.

    In a stage whose inputs are ``submap`` and ``color``::

        def setup(self):
            self.join = replica.SubmapJoin("color")

        def step(self, inputs, outputs):
            for submap, columns in self.join.complete(inputs):
                columns["color"]["r"]

        def save(self):
            return self.join.save()

        def restore(self, state):
            self.join.restore(state)
    """

    def __init__(self, *columns: str):
        """Columns that every submap waits for; optional columns only if they are in ``context.connected``."""
        self._waiting: dict[str, list[Message]] = {topic: [] for topic in ("submap", *columns)}

    def complete(self, inputs: Inputs) -> Iterator[tuple[Message, dict[str, Message]]]:
        """Adds the messages of a tick. Returns the submaps that have all of their columns, in their order."""
        for topic, waiting in self._waiting.items():
            waiting.extend(inputs[topic])
        while all(self._waiting.values()):
            submap, *columns = (waiting.pop(0) for waiting in self._waiting.values())
            for column in columns:
                if (column.seq, len(column)) != (submap.seq, len(submap)):
                    raise ValueError(f"{column!r} arrived when the column of {submap!r} was due")
            yield submap, {column.topic: column for column in columns}

    def save(self) -> bytes:
        """The waiting messages as bytes; empty if no message waits."""
        waiting = [_parts(message) for messages in self._waiting.values() for message in messages]
        return pickle.dumps(waiting) if waiting else b""

    def restore(self, state: bytes):
        """Restores what :meth:`save` returned."""
        for topic, seq, stamp, tick, header, rows in pickle.loads(state):
            message = Message(topic, seq, stamp, tick, np.frombuffer(header, "u1"), np.frombuffer(rows, "u1"), dtypes(topic))
            self._waiting[topic].append(message)


def _parts(message: Message) -> tuple:
    return message.topic, message.seq, message.stamp, message.tick, message.header.tobytes(), message.rows.tobytes()
