#!/usr/bin/env python3
"""Writes the U-Net of a model file as ONNX, without PyTorch: unet_to_onnx.py models/street.safetensors street.onnx

pip install onnx safetensors
"""

import sys

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from safetensors.numpy import load_file

weights = load_file(sys.argv[1])
# One column on the left and on the right: the opposite edge. Rows and columns are repeated twice.
weights |= {"border": np.array([0, 0, 0, 1, 0, 0, 0, 1]), "twice": np.array([1, 1, 2, 2], "f4")}
nodes = []


def add(kind, *inputs, **attributes):
    """Appends a node. Returns the name of its output."""
    nodes.append(helper.make_node(kind, inputs, [f"{kind}_{len(nodes)}"], **attributes))
    return nodes[-1].output[0]


def layer(image, name):
    """A convolution; all but the last one have a rectifier."""
    if weights[f"{name}.weight"].shape[2:] == (3, 3):
        image = add("Pad", image, "border", mode="wrap")
        image = add("Conv", image, f"{name}.weight", f"{name}.bias", pads=[1, 0, 1, 0])
    else:
        image = add("Conv", image, f"{name}.weight", f"{name}.bias")
    return image if name == "classes" else add("Relu", image)


n_levels = sum(name.startswith("down.") and name.endswith(".0.weight") for name in weights)
image, finer = "images", []
for level in range(n_levels):
    if level > 0:
        finer.append(image)
        image = add("MaxPool", image, kernel_shape=[2, 2], strides=[2, 2])
    image = layer(layer(image, f"down.{level}.0"), f"down.{level}.1")
for level in reversed(range(n_levels - 1)):
    coarser = add("Resize", layer(image, f"up.{level}.0"), "", "twice", mode="nearest")
    image = layer(add("Concat", finer.pop(), coarser, axis=1), f"up.{level}.1")
nodes.append(helper.make_node("Identity", [layer(image, "classes")], ["scores"]))

n_in, n_out = weights["down.0.0.weight"].shape[1], weights["classes.weight"].shape[0]
images = helper.make_tensor_value_info("images", TensorProto.FLOAT, ["n", n_in, "rows", "columns"])
scores = helper.make_tensor_value_info("scores", TensorProto.FLOAT, ["n", n_out, "rows", "columns"])
initializers = [numpy_helper.from_array(values, name) for name, values in weights.items()]
graph = helper.make_graph(nodes, "unet", [images], [scores], initializers)
# Opset 19 is the first with the padding `wrap`.
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 19)], ir_version=9)
onnx.checker.check_model(model)
onnx.save(model, sys.argv[2])
