#!/usr/bin/env python3
"""Classes from an ONNX network that processes points one by one: rows of x, y, z (m, submap frame) and intensity; a score for each class."""

import os

import numpy as np
import onnxruntime as ort

import replica
from replica import Setting


class OnnxSegmenter(replica.Stage):
    name, inputs, outputs = "infer", ["submap"], ["class"]
    settings = {
        "model": Setting("model.onnx", "Network: float [points, 4] to scores [points, classes], classes by id."),
        "batch": Setting(1 << 16, "Points that go through the network together.", at_least=1),
    }

    @classmethod
    def check(cls, settings, context):
        if not context.resolve(settings["model"]).is_file():
            yield "model", f"{context.resolve(settings['model'])}: no such file"

    def setup(self):
        model = self.context.resolve(self.settings["model"])
        options = ort.SessionOptions()
        # The key `threads` of the stage's table; 0 = one per core.
        options.intra_op_num_threads = int(os.environ.get("OMP_NUM_THREADS", 0))
        self.session = ort.InferenceSession(model, options, providers=["CPUExecutionProvider"])
        self.digest = replica.fingerprint(model.read_bytes())

    def step(self, inputs, outputs):
        for submap in inputs["submap"]:
            out = outputs.loan("class", like=submap)
            out.header["model_digest"] = self.digest
            for first in range(0, len(submap), self.settings["batch"]):
                rows = slice(first, first + self.settings["batch"])
                points = np.stack([submap[field][rows].astype("f4") for field in ("x", "y", "z", "intensity")], axis=1)
                (scores,) = self.session.run(None, {self.session.get_inputs()[0].name: points})
                odds = np.exp(scores - scores.max(axis=1, keepdims=True))
                out["class_id"][rows] = scores.argmax(axis=1)
                out["score"][rows] = 255 * odds.max(axis=1) / odds.sum(axis=1)
            outputs.publish(out)


if __name__ == "__main__":
    replica.run(OnnxSegmenter)
