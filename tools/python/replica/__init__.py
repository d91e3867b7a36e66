"""Stages, runs and recordings of REPLICA in Python.

A stage is a class with a method ``step``::

    import replica

    class Segmenter(replica.Stage):
        name = "infer"
        inputs = ["submap"]
        outputs = ["class"]
        settings = {"ground_m": replica.Setting(0.3, "Height up to which a point is ground, m", within=(0.05, 1.0))}

        def step(self, inputs, outputs):
            for submap in inputs["submap"]:
                out = outputs.loan("class", like=submap)
                out["class_id"][:] = submap["z"] < self.settings["ground_m"]
                outputs.publish(out)

    if __name__ == "__main__":
        replica.run(Segmenter)

``[infer] program = "segmenter.py"`` in the launch file starts it.
"""

from ._columns import COLUMNS, Column, Field
from ._images import SubmapImages, SweepImages
from ._join import SubmapJoin
from ._messages import CLASS_NAMES, CLASS_TABLE_VERSION, Inputs, Loan, Message, Outputs
from ._native import fingerprint
from ._reading import Cloud, Recording, Run, observe, open_recording, open_run, read_ply
from ._stage import END, ConfigurationError, Context, Setting, Stage, run

__all__ = [
    "CLASS_NAMES",
    "CLASS_TABLE_VERSION",
    "COLUMNS",
    "Cloud",
    "Column",
    "ConfigurationError",
    "Context",
    "END",
    "Field",
    "Inputs",
    "Loan",
    "Message",
    "Outputs",
    "Recording",
    "Run",
    "Setting",
    "Stage",
    "SubmapImages",
    "SubmapJoin",
    "SweepImages",
    "fingerprint",
    "observe",
    "open_recording",
    "open_run",
    "read_ply",
    "run",
]
