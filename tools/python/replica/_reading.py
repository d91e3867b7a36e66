"""Reading of finished runs, recordings and running pipelines."""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from . import _native
from ._columns import COLUMNS, Column
from ._layouts import dtypes_of
from ._messages import Message

#: Observers are not notified, so they poll, s.
_POLL_INTERVAL_S = 0.002
#: Between two attempts of a run, its services are absent for less than this, s.
_ATTEMPT_TIMEOUT_S = 10.0
_PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2", "int": "<i4", "uint": "<u4", "float": "<f4", "double": "<f8"}
_POSE = np.dtype([("stamp_s", "f8"), ("position", "f8", (3,)), ("rotation", "f8", (4,))])


@dataclass(frozen=True)
class Cloud:
    """The points of a submap, in a PLY file."""

    path: Path
    #: Lines ``obj_info`` of the file: frame, pose and standard deviations of the submap.
    info: tuple[str, ...]
    #: The points, a structured array in the mapped file, read-only.
    points: np.ndarray

    def values(self, name: str, columns: tuple[Column, ...] = COLUMNS) -> np.ma.MaskedArray:
        """A field of :data:`COLUMNS` by its name, such as ``class``, or any property of the file. Points without a value are masked."""
        fields = (field for column in columns for field in column.fields if name in (field.name, field.property))
        field = next(fields, None)
        key = name if field is None else field.property
        if key not in (self.points.dtype.names or ()):
            raise ValueError(f"{self.path}: has no field of name {name}; it has {', '.join(self.points.dtype.names or ())}")
        is_none = np.ma.nomask if field is None or field.none is None else self.points[key] == field.none
        return np.ma.masked_array(self.points[key], is_none)


@dataclass(frozen=True)
class Run:
    """The output folder of a run."""

    path: Path

    @cached_property
    def summary(self) -> dict:
        """``summary.json``."""
        return self._json("summary.json")

    @cached_property
    def index(self) -> dict:
        """``clouds/index.json``."""
        return self._json("clouds/index.json")

    @property
    def clouds(self) -> Iterator[Cloud]:
        """The clouds in the order of the drive."""
        for cloud in self.index["clouds"]:
            yield read_ply(self.path / cloud["file"])

    @cached_property
    def trajectory(self) -> np.ndarray:
        """``world_from_body``: ``stamp_s`` (s since the Unix epoch), ``position`` (m), ``rotation`` (x y z w)."""
        return np.loadtxt(self.path / "trajectory.txt", dtype="f8", ndmin=2).view(_POSE)[:, 0]

    def _json(self, name: str) -> dict:
        return json.loads((self.path / name).read_text())


def open_run(path: str | Path) -> Run:
    """The run with the output folder ``path``."""
    path = Path(path)
    if not (path / "clouds/index.json").is_file():
        raise FileNotFoundError(f"{path}: is not the output of a run: it has no clouds/index.json")
    return Run(path)


def read_ply(path: str | Path) -> Cloud:
    """A cloud of a run: binary little-endian PLY."""
    path = Path(path)
    with path.open("rb") as file:
        lines: list[str] = []
        while (line := file.readline(1 << 16).decode("ascii", "replace").rstrip("\n")) != "end_header":
            if not line or len(lines) > 1000 or lines[:1] not in ([], ["ply"]):
                raise ValueError(f"{path}: line {len(lines) + 1}: {line!r} is not a line of a PLY header")
            lines.append(line)
        offset = file.tell()
    words = [line.split() for line in lines]
    if ["format", "binary_little_endian", "1.0"] not in words:
        raise ValueError(f"{path}: must have format binary_little_endian 1.0")
    n_points = next(int(word[2]) for word in words if word[:2] == ["element", "vertex"])
    fields = np.dtype([(word[2], _PLY_TYPES[word[1]]) for word in words if word[0] == "property"])
    # An empty file section cannot be mapped.
    points = np.memmap(path, fields, "r", offset, (n_points,)) if n_points else np.empty(0, fields)
    return Cloud(path, tuple(line.removeprefix("obj_info ") for line in lines if line.startswith("obj_info ")), points)


class Recording:
    """A recording: an MCAP file of topics."""

    def __init__(self, path: str | Path):
        self.path = Path(path)
        file = _native.RecordingFile(self.path)
        #: Metadata of the run, from the recording.
        self.about: dict[str, str] = file.about()
        self._tables: dict[str, dict] = json.loads(file.tables())

    @property
    def topics(self) -> list[str]:
        """Its topics."""
        return [name for name in self._tables if not name.endswith(".tick")]

    def messages(self, *topics: str) -> Iterator[Message]:
        """The messages of these topics, by default of all topics, in the order of the file. Arrays may be kept."""
        unknown = [topic for topic in topics if topic not in self._tables]
        if unknown:
            raise ValueError(f"{self.path}: has no topic {', '.join(unknown)}; it has {', '.join(self.topics)}")
        types = {topic: dtypes_of(self._tables[topic]) for topic in topics or self.topics}
        file = _native.RecordingFile(self.path)
        while (message := file.next(list(types))) is not None:
            topic, envelope, header, rows = message
            seq, stamp, tick = (int(number) for number in np.frombuffer(envelope, "<i8", 3))
            yield Message(topic, seq, stamp, tick, np.frombuffer(header, "u1"), np.frombuffer(rows, "u1"), types[topic])


def open_recording(path: str | Path) -> Recording:
    """The recording ``path``. Layouts come from the file, so that recordings of other versions can be read."""
    return Recording(path)


def observe(output: str | Path, topic: str, *, lossless: bool = False) -> Iterator[Message]:
    """The messages of a topic of the running pipeline into ``output``, until it ends, across restarts.

    An observer changes no result. A message that comes while its queue is full is dropped: ``seq`` has a gap. With ``lossless``,
    the pipeline waits for it instead; one such observer for a topic. Arrays of few messages may be kept.
    """
    attempt = None
    while (observation := _attach(Path(output), topic, lossless, attempt)) is not None:
        attempt = observation.attempt()
        types = dtypes_of(json.loads(observation.table(topic)))
        while True:
            has_ended = observation.has_ended()
            if (message := observation.receive()) is not None:
                seq, stamp, tick, header, rows = message
                yield Message(topic, seq, stamp, tick, np.asarray(header), np.asarray(rows), types)
                # From here on, only the caller may refer to the message.
                del message, header, rows
            elif has_ended:
                break
            else:
                time.sleep(_POLL_INTERVAL_S)
        del observation


def _attach(output: Path, topic: str, lossless: bool, attempt: int | None):
    """The observation of the next attempt; `None` if the run has ended after an attempt was observed."""
    begun = time.monotonic()
    while True:
        try:
            observation = _native.Observation(output, topic, lossless)
            if observation.attempt() != attempt:
                return observation
            # The same attempt, which is being removed.
            del observation
        except OSError:
            if attempt is None and time.monotonic() - begun > _ATTEMPT_TIMEOUT_S:
                raise
        if attempt is not None and time.monotonic() - begun > _ATTEMPT_TIMEOUT_S:
            return None
        time.sleep(_POLL_INTERVAL_S)
