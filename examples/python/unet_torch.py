#!/usr/bin/env python3
"""The U-Net of a model file in PyTorch, in place of the stage `infer`: pip install torch safetensors."""

import torch
from safetensors.torch import load_file
from torch import nn
from torch.nn.functional import interpolate, max_pool2d, relu

import replica
from replica import Setting


class Circular(nn.Conv2d):
    """A 3 x 3 convolution and a rectifier. Columns are the angles of a revolution; above and below there are zeros."""

    def __init__(self, n_in, n_out):
        super().__init__(n_in, n_out, 3, padding=(1, 0))

    def forward(self, image):
        # Not the mode "circular" of `pad`, which torch.onnx.export of PyTorch 1.13 converts to something else.
        return relu(super().forward(torch.cat([image[..., -1:], image, image[..., :1]], dim=3)))


class Unet(nn.Module):
    """Its weights have the names of the model file."""

    def __init__(self, inputs, outputs, widths, head=None):
        super().__init__()
        channels = [inputs, *widths]
        self.down = nn.ModuleList(nn.Sequential(Circular(n, m), Circular(m, m)) for n, m in zip(channels, widths))
        above = [head or widths[0], *widths[1:]]
        up = [(nn.Conv2d(above[i + 1], n, 1), Circular(2 * n, above[i])) for i, n in enumerate(widths[:-1])]
        self.up = nn.ModuleList(nn.ModuleList(pair) for pair in up)
        self.classes = nn.Conv2d(above[0], outputs, 1)

    def forward(self, image):
        finer = []
        for level, down in enumerate(self.down):
            image = down(max_pool2d(image, 2) if level else image)
            finer.append(image)
        finer.pop()
        for narrow, merge in reversed(self.up):
            coarser = interpolate(relu(narrow(image)), scale_factor=2)
            image = merge(torch.cat([finer.pop(), coarser], dim=1))
        return self.classes(image)


class UnetSegmenter(replica.Stage):
    name, inputs, outputs = "infer", ["submap"], ["class"]
    settings = {"model": Setting("models/street.safetensors", "Model file of a U-Net on images.")}

    def setup(self):
        torch.use_deterministic_algorithms(True)
        model = self.context.resolve(self.settings["model"])
        self.images = replica.SweepImages(model)
        network = self.images.settings["network"]
        self.network = Unet(network["inputs"], network["outputs"], network["widths"], network.get("head"))
        self.network.load_state_dict(load_file(model))

    @torch.inference_mode()
    def step(self, inputs, outputs):
        for submap in inputs["submap"]:
            sweeps = self.images.project(submap)
            out = outputs.loan("class", like=submap)
            out.header["model_digest"] = self.images.digest
            out[:] = sweeps.classes(self.network(torch.from_numpy(images)) for images in sweeps.images())
            outputs.publish(out)


if __name__ == "__main__":
    replica.run(UnetSegmenter)
