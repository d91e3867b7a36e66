#!/usr/bin/env python3
"""A small U-Net in PyTorch, written as a model file that `segmentation::load` reads, with an input and the output of torch.

    python3 shared/segmentation/tests/data/torch_unet.py shared/segmentation/tests/data/torch_unet.safetensors
"""
import json, struct, sys
import torch
from torch import nn
from torch.nn import functional as F

FEATURES, FOLD, CLASSES, COLUMNS, WIDTHS, HEAD = 10, 2, ["road", "building", "vegetation"], 64, [6, 18], 8


class Conv(nn.Conv2d):
    """Columns go around the turn, rows end in zeros."""

    def forward(self, x):
        side = self.kernel_size[0] // 2
        return super().forward(F.pad(F.pad(x, (side, side, 0, 0), mode="circular"), (0, 0, side, side)))


class UNet(nn.Module):
    def __init__(self, inputs, outputs, widths, head):
        super().__init__()
        ins = [inputs, *widths]
        self.down = nn.ModuleList(nn.ModuleList([Conv(ins[i], w, 3), Conv(w, w, 3)]) for i, w in enumerate(widths))
        self.up = nn.ModuleList(
            nn.ModuleList([Conv(widths[i + 1], w, 1), Conv(2 * w, w if i else head, 3)]) for i, w in enumerate(widths[:-1])
        )
        self.classes = Conv(head, outputs, 1)

    def forward(self, x):
        finer = []
        for level, (a, b) in enumerate(self.down):
            if level:
                finer.append(x)
                x = F.max_pool2d(x, 2)
            x = F.relu(b(F.relu(a(x))))
        for a, b in list(self.up)[::-1]:
            large = F.interpolate(F.relu(a(x)), scale_factor=2, mode="nearest")
            x = F.relu(b(torch.cat([finer.pop(), large], 1)))
        return self.classes(x)


torch.manual_seed(1)
network = UNet(FOLD * FEATURES, FOLD * len(CLASSES), WIDTHS, HEAD)
image = torch.randn(1, FOLD * FEATURES, 4, COLUMNS // FOLD)
with torch.no_grad():
    tensors = dict(network.state_dict(), **{"test.input": image[0], "test.output": network(image)[0]})

spec = {"kind": "unet", "inputs": FOLD * FEATURES, "outputs": FOLD * len(CLASSES), "widths": WIDTHS, "head": HEAD}
settings = {"network": spec, "columns": COLUMNS, "fold": FOLD, "classes": CLASSES, "vote_cell_m": 0.2, "temperature": 1.0}
card = {"architecture": "spherical", "version": 1, "settings": settings}
# safetensors: the length of a JSON header, the header, the numbers.
header, data = {"__metadata__": {"model": json.dumps(card)}}, b""
for name, tensor in tensors.items():
    numbers = tensor.contiguous().numpy().astype("<f4").tobytes()
    header[name] = {"dtype": "F32", "shape": list(tensor.shape), "data_offsets": [len(data), len(data) + len(numbers)]}
    data += numbers
text = json.dumps(header).encode()
text += b" " * (-len(text) % 8)
with open(sys.argv[1], "wb") as file:
    file.write(struct.pack("<Q", len(text)) + text + data)
