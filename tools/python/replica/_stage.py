"""A stage of the pipeline as a class, and the ``main`` of its program."""

import gc
import inspect
import json
import sys
import traceback
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import _native
from ._layouts import dtypes
from ._messages import Inputs, Message, Outputs

#: Returned by ``step`` of a source (a stage without inputs) with its last tick.
END = "end"


class ConfigurationError(Exception):
    """The settings require data that this drive lacks: the process ends with exit code 78 and is not restarted."""


@dataclass(frozen=True)
class Setting:
    """A setting: default, meaning with its unit, and the rule of its values. The default gives the type."""

    default: bool | int | float | str | list
    meaning: str = ""
    within: tuple[float, float] | None = None
    at_least: float | None = None
    one_of: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Context:
    """Folders and mode of the run."""

    drive: Path
    output: Path
    launch_folder: Path
    #: ``offline`` or ``live``.
    mode: str
    #: Topics that have a producer in this run.
    connected: tuple[str, ...]
    #: Topics that have no producer because another source was selected.
    missing: tuple[str, ...]

    def resolve(self, path: str | Path) -> Path:
        """The file that a setting names: relative to the launch file, or installed with the programs."""
        return Path(_native.find_file(self.launch_folder, path))

    @classmethod
    def _of(cls, text: str) -> "Context":
        values = json.loads(text)
        drive, output, launch_folder = (Path(values[key]) for key in ("drive", "output", "launch_folder"))
        return cls(drive, output, launch_folder, values["mode"], tuple(values["connected"]), tuple(values["missing"]))


class Stage:
    """A stage: a function of settings, state and the messages of a tick.

    ``step`` reads no clock, file, environment or unseeded randomness: so the same input gives the same bytes, and a run that
    was killed continues as if it had not been. It reports by ``outputs.count``, ``outputs.note`` and ``outputs.doubt``.
    """

    #: Table in launch.toml.
    name: str
    #: Topics that it reads; the run does not start unless each has a producer.
    inputs: list[str] = []
    #: Topics that it reads if they have a producer.
    optional_inputs: list[str] = []
    #: Topics that it writes.
    outputs: list[str] = []
    #: Defaults by key: values, or :class:`Setting` with meaning and rule. In an instance, the values.
    settings: dict = {}
    #: The context of the run, in an instance.
    context: Context

    @classmethod
    def check(cls, settings: dict, context: Context):
        """Problems found before the start, beyond the rules of the settings: pairs of key and text."""
        return []

    def setup(self):
        """Before the first tick: reads models. ``self.settings`` and ``self.context`` are set."""

    def step(self, inputs: Inputs, outputs: Outputs):
        """One tick."""
        raise NotImplementedError("a stage needs a method step(self, inputs, outputs)")

    def finish(self, outputs: Outputs):
        """After the last tick: publishes the remaining results."""

    def save(self) -> bytes:
        """The state that the next tick depends on. A stage without state returns no bytes."""
        return b""

    def restore(self, state: bytes):
        """Restores what :meth:`save` returned, in a new stage before its first tick."""
        raise ValueError(f"this program has no state and cannot restore one of {len(state)} bytes")


class _Host:
    """Interface for the native part. Texts are JSON."""

    def __init__(self, stage_class: type[Stage]):
        self.stage_class = stage_class
        self.stage: Stage
        self.outputs = Outputs()

    def spec(self) -> str:
        cls = self.stage_class
        settings = [{"key": key, **_setting(value).__dict__} for key, value in cls.settings.items()]
        topics = {key: list(getattr(cls, key)) for key in ("inputs", "optional_inputs", "outputs")}
        return json.dumps({"name": cls.name, "settings": settings, **topics})

    def _values(self, changed: str) -> dict:
        defaults = {key: _setting(value).default for key, value in self.stage_class.settings.items()}
        return defaults | json.loads(changed)

    def all_settings(self, changed: str) -> str:
        return json.dumps(self._values(changed))

    def check(self, changed: str, context: str) -> list[tuple[str, str]]:
        return [(key, str(text)) for key, text in self.stage_class.check(self._values(changed), Context._of(context))]

    def build(self, changed: str, context: str):
        stage = self.stage_class()
        stage.settings, stage.context = self._values(changed), Context._of(context)
        self.stage = stage
        stage.setup()

    def step(self, messages: list) -> bool:
        return self.stage.step(self._inputs(messages), self.outputs) == END

    def _inputs(self, messages: list) -> Inputs:
        inputs = Inputs((topic, []) for topic in [*self.stage_class.inputs, *self.stage_class.optional_inputs])
        for topic, seq, stamp, tick, header, rows in messages:
            inputs[topic].append(Message(topic, seq, stamp, tick, np.asarray(header), np.asarray(rows), dtypes(topic)))
        # From here on, only the inputs refer to the messages.
        messages.clear()
        return inputs

    def finish(self):
        self.stage.finish(self.outputs)

    def save(self) -> bytes:
        return bytes(self.stage.save())

    def restore(self, state: bytes):
        self.stage.restore(state)

    def collect(self):
        gc.collect()

    def explain(self, error: BaseException, raised_at) -> tuple[bool, str, str]:
        """Whether the error is a configuration error, its traceback, and one line with its place in the stage's file."""
        text = " ".join(str(error).split())
        if isinstance(error, ConfigurationError):
            return True, "", text
        package = Path(__file__).parent
        frames = [frame for frame in traceback.extract_tb(raised_at) if Path(frame.filename).parent != package]
        shown = "".join(["Traceback (most recent call last):\n", *traceback.format_list(frames)]).rstrip()
        in_file = [frame for frame in frames if frame.filename == inspect.getfile(self.stage_class)]
        place = "".join(f"{Path(frame.filename).name}:{frame.lineno}: " for frame in (in_file or frames)[-1:])
        return False, shown, f"{place}{type(error).__name__}: {text}"


def _setting(value) -> Setting:
    return value if isinstance(value, Setting) else Setting(value)


def run(stage_class: type[Stage]):
    """The ``main`` of a stage's program: ``--describe``, ``--check``, ``run``; ends the process with its exit code."""
    host = _Host(stage_class)
    sys.exit(_native.run(host, host.spec(), sys.argv))
