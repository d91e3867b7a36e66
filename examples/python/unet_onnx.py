#!/usr/bin/env python3
"""Runs a network on range images in ONNX Runtime, in place of the stage `infer`: pip install onnxruntime.

unet_to_onnx.py writes the network of a model file; torch.onnx.export writes a PyTorch network, with dynamic axes for images and rows.
"""

import os

import onnxruntime as ort

import replica
from replica import Setting


class OnnxImageSegmenter(replica.Stage):
    name, inputs, outputs = "infer", ["submap"], ["class"]
    settings = {
        "model": Setting("models/street.safetensors", "Model file whose settings make the images."),
        "network": Setting("street.onnx", "Network: float [n, channels, rows, columns] to scores [n, outputs, rows, columns]."),
    }

    @classmethod
    def check(cls, settings, context):
        for key in ("model", "network"):
            if not context.resolve(settings[key]).is_file():
                yield key, f"{context.resolve(settings[key])}: no such file"

    def setup(self):
        network = self.context.resolve(self.settings["network"]).read_bytes()
        options = ort.SessionOptions()
        options.use_deterministic_compute = True
        # The key `threads` of the stage's table; 0 = one per core.
        options.intra_op_num_threads = int(os.environ.get("OMP_NUM_THREADS", 0))
        self.session = ort.InferenceSession(network, options, providers=["CPUExecutionProvider"])
        self.input = self.session.get_inputs()[0].name
        self.images = replica.SweepImages(self.context.resolve(self.settings["model"]))
        self.digest = replica.fingerprint(network)

    def step(self, inputs, outputs):
        for submap in inputs["submap"]:
            sweeps = self.images.project(submap)
            out = outputs.loan("class", like=submap)
            out.header["model_digest"] = self.digest
            out[:] = sweeps.classes(self.session.run(None, {self.input: images})[0] for images in sweeps.images())
            outputs.publish(out)


if __name__ == "__main__":
    replica.run(OnnxImageSegmenter)
