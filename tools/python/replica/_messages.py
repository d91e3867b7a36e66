"""Messages that a step reads and writes, in shared memory."""

import numpy as np

from . import _native
from ._layouts import dtypes

#: Version and names of the classes by id.
CLASS_TABLE_VERSION, CLASS_NAMES = _native.classes()


class Message:
    """A received message. Its arrays are read-only views of shared memory, and keep it readable as long as they live.

    A stage may keep few messages, or arrays of them, after its step: more is an error. Keep copies instead.
    """

    __slots__ = ("topic", "seq", "stamp", "tick", "header", "rows")

    def __init__(self, topic: str, seq: int, stamp: int, tick: int, header: np.ndarray, rows: np.ndarray, types):
        header_type, row_type = types
        self.topic = topic
        #: Number of the message on its topic; for a column, the number of its submap.
        self.seq = seq
        #: Nanoseconds since the Unix epoch.
        self.stamp = stamp
        #: Step of the source that the message belongs to.
        self.tick = tick
        #: The fixed part, a record.
        self.header = header.view(header_type)[0]
        #: The rows, a structured array; for a topic of plain numbers, an array of numbers.
        self.rows = rows.view(row_type)

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, key):
        """A field of all rows, ``message["x"]``; or rows, as ``message.rows[key]``."""
        return self.rows[key]

    def __repr__(self) -> str:
        return f"<{self.topic} {self.seq}: {len(self)} rows>"


class Loan:
    """A message under construction, in the shared memory from which its readers will read it. Rows and header are zero at first."""

    __slots__ = ("topic", "header", "rows", "_number", "_stamp", "_seq")

    def __init__(self, topic: str, n_rows: int, stamp: int | None, seq: int | None):
        header_type, row_type = dtypes(topic)
        self.topic = topic
        self._stamp, self._seq = stamp, seq
        self._number, header, rows = _native.loan(topic, n_rows)
        self.header = np.asarray(header).view(header_type)[0]
        self.rows = np.asarray(rows).view(row_type)
        if topic == "class":
            self.header["class_table_version"] = CLASS_TABLE_VERSION

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, key):
        """A field of all rows, to be written: ``loan["class_id"][:] = classes``."""
        return self.rows[key]

    def __setitem__(self, key, value):
        self.rows[key] = value

    def __getattr__(self, name: str):
        """Called for missing attributes."""
        if name in ("header", "rows"):
            raise RuntimeError(f"{self.topic}: the loan is published: its memory belongs to the readers")
        raise AttributeError(name)

    def _publish(self, stamp: int | None):
        stamp = self._stamp if stamp is None else stamp
        if stamp is None:
            raise ValueError(f"{self.topic}: publish needs a stamp for a loan that was made without `like`")
        # Only arrays that the stage keeps still refer to the loan. A second call has nothing to delete.
        try:
            del self.header, self.rows
        except AttributeError:
            pass
        _native.publish(self._number, self.topic, stamp, self._seq)


class Inputs(dict):
    """The messages of a tick by topic, in the order they were published."""


class Outputs:
    """The outputs of a step. Usable only within ``step`` and ``finish``."""

    def loan(self, topic: str, rows: int | None = None, *, like: Message | None = None) -> Loan:
        """Memory for a message of ``rows`` rows. ``like``: a column of that submap, with as many rows and its stamp."""
        if like is not None and rows is None:
            return Loan(topic, len(like), like.stamp, like.seq)
        if rows is not None and like is None:
            return Loan(topic, rows, None, None)
        raise ValueError(f"{topic}: a loan needs either rows=N or like=MESSAGE")

    def publish(self, loan: Loan, stamp: int | None = None):
        """Publishes the loan. Waits while the queue of a reader is full; other threads of Python run meanwhile.

        No other array may refer to the loan: ``BufferError``. ``stamp``, ns since the Unix epoch, defaults to the stamp of ``like``.
        """
        loan._publish(stamp)

    def count(self, name: str, n: int = 1):
        """Adds to a counter of the run summary."""
        _native.count(name, n)

    def note(self, text: str):
        """Reports a text to the operator once, in the log, the heartbeat and the run summary."""
        _native.note(text)

    def doubt(self, name: str, size: float, text: str):
        """Reports that results should not be relied on without a check: the run ends with exit code 3."""
        _native.doubt(name, size, text)

    def withdraw_doubt(self, name: str):
        """Withdraws the doubt."""
        _native.doubt(name, 0.0, None)

    def mark_progress(self):
        """Reports progress within a step that takes long: the time after which it counts as stalled starts again."""
        _native.mark_progress()

    def set_drive_time(self, stamp: int, progress: float = 0.0):
        """Sources only: the drive's time at this tick, ns since the Unix epoch, and the share that has been read, 0 to 1."""
        _native.set_drive_time(stamp, progress)
