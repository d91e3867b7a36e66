#!/usr/bin/env python3
"""Convolutions and the shipped network compared with ONNX Runtime, one thread each, in one run.

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install onnxruntime onnx numpy
    cargo build --release -p studies --examples
    /tmp/venv/bin/python lab/peers/segmentation.py [MODEL]

Times of convolutions are the fastest of several runs, times of networks means of processor time: the machine may be shared.
"""
import json, os, struct, subprocess, sys, time
import numpy as np
import onnx, onnxruntime as ort
from onnx import TensorProto, helper, numpy_helper

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
RELEASE = os.path.join(os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target")), "release")
ONE_THREAD = dict(os.environ, RAYON_NUM_THREADS="1", OMP_NUM_THREADS="1")


def session(nodes, initializers, n_in, n_out, height, width):
    image = helper.make_tensor_value_info("in", TensorProto.FLOAT, [1, n_in, height, width])
    result = helper.make_tensor_value_info("out", TensorProto.FLOAT, [1, n_out, height, width])
    graph = helper.make_graph(nodes, "net", [image], [result], initializers)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 9
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return ort.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])


def fastest_ms(run, n=15):
    times = []
    for _ in range(n):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return 1e3 * min(times)


def mean_processor_ms(run, n=50):
    run()
    begin = time.process_time()
    for _ in range(n):
        run()
    return 1e3 * (time.process_time() - begin) / n


def convolutions():
    lines = subprocess.run([f"{RELEASE}/examples/bench_convolution"], env=ONE_THREAD, check=True, capture_output=True, text=True).stdout.splitlines()
    print("| in -> out, size, kernel | ours ms | GF/s | ONNX Runtime ms | candle ms | ORT / ours | candle / ours |\n|---|---|---|---|---|---|---|")
    for line in lines[1:]:
        v = line.split("\t")
        n_in, n_out, height, width, side = map(int, v[:5])
        weights = np.random.default_rng(1).normal(size=(n_out, n_in, side, side)).astype(np.float32)
        node = helper.make_node("Conv", ["in", "w"], ["out"], kernel_shape=[side] * 2, pads=[side // 2] * 4)
        s = session([node], [numpy_helper.from_array(weights, "w")], n_in, n_out, height, width)
        image = np.random.default_rng(2).normal(size=(1, n_in, height, width)).astype(np.float32)
        theirs = fastest_ms(lambda: s.run(None, {"in": image}))
        ours, candle = float(v[5]), float(v[9])
        print(f"| {n_in} -> {n_out}, {height} x {width}, {side} x {side} | {ours:.2f} | {v[6]} | {theirs:.2f} | {candle:.1f} | {theirs / ours:.2f} | {candle / ours:.1f} |")


def network_session(path):
    """Runs the model's U-Net as ONNX once, with zeros instead of the other edge beyond the seam, which is cheaper for ONNX Runtime."""
    data = open(path, "rb").read()
    n = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8 : 8 + n])
    settings = json.loads(header["__metadata__"]["model"])["settings"]
    net = settings["network"]
    assert net["kind"] == "unet", "only the U-Net is written as ONNX here"

    def tensor(name):
        begin, end = header[name]["data_offsets"]
        return np.frombuffer(data[8 + n + begin : 8 + n + end], np.float32).reshape(header[name]["shape"])

    nodes, initializers, count = [], [], [0]

    def conv(source, name, rectify=True):
        weight = tensor(f"{name}.weight")
        for kind in ["weight", "bias"]:
            initializers.append(numpy_helper.from_array(tensor(f"{name}.{kind}").copy(), f"{name}.{kind}"))
        out = name if rectify else "out"
        pads = [weight.shape[2] // 2, weight.shape[3] // 2] * 2
        nodes.append(helper.make_node("Conv", [source, f"{name}.weight", f"{name}.bias"], [out], kernel_shape=weight.shape[2:], pads=pads))
        if rectify:
            nodes.append(helper.make_node("Relu", [out], [out + ".r"]))
            out += ".r"
        return out

    image, finer = "in", []
    for level in range(len(net["widths"])):
        if level:
            finer.append(image)
            nodes.append(helper.make_node("MaxPool", [image], [f"pool{level}"], kernel_shape=[2, 2], strides=[2, 2]))
            image = f"pool{level}"
        image = conv(conv(image, f"down.{level}.0"), f"down.{level}.1")
    initializers.append(numpy_helper.from_array(np.array([1, 1, 2, 2], np.float32), "twice"))
    for level in reversed(range(len(net["widths"]) - 1)):
        narrow = conv(image, f"up.{level}.0")
        nodes.append(helper.make_node("Resize", [narrow, "", "twice"], [f"large{level}"], mode="nearest", coordinate_transformation_mode="asymmetric", nearest_mode="floor"))
        nodes.append(helper.make_node("Concat", [finer.pop(), f"large{level}"], [f"both{level}"], axis=1))
        image = conv(f"both{level}", f"up.{level}.1")
    conv(image, "classes", rectify=False)
    height, width = 32, settings["columns"] // settings["fold"]
    s = session(nodes, initializers, net["inputs"], net["outputs"], height, width)
    pixels = np.random.default_rng(3).normal(size=(1, net["inputs"], height, width)).astype(np.float32)
    return lambda: s.run(None, {"in": pixels})


def our_network(path):
    return subprocess.run([f"{RELEASE}/examples/bench_network", path], env=ONE_THREAD, check=True, capture_output=True, text=True).stdout


def network(path):
    theirs = mean_processor_ms(network_session(path))
    print(our_network(path))
    print(f"ONNX Runtime {ort.__version__}, the same network, one thread: {theirs:.2f} ms")


if __name__ == "__main__":
    convolutions()
    network(sys.argv[1] if len(sys.argv) > 1 else os.path.join(ROOT, "models", "street.safetensors"))
