"""Examples and new stages work without changes."""

import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT, call

import replica

ONNX_SEGMENTER = ROOT / "examples/python/onnx_segmenter.py"


def test_onnx_network_classifies_the_points_of_a_recording(tmp_path, submaps):
    onnx = pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    # Class 1 for points above 1 m, else class 0.
    weights = np.array([[0, 0], [0, 0], [0, 1], [0, 0]], "f4")
    nodes = [onnx.helper.make_node("Gemm", ["points", "weights", "bias"], ["scores"])]
    initializers = [onnx.numpy_helper.from_array(weights, "weights"), onnx.numpy_helper.from_array(np.array([0, -1], "f4"), "bias")]
    points = onnx.helper.make_tensor_value_info("points", onnx.TensorProto.FLOAT, ["n", 4])
    scores = onnx.helper.make_tensor_value_info("scores", onnx.TensorProto.FLOAT, ["n", 2])
    graph = onnx.helper.make_graph(nodes, "net", [points], [scores], initializers)
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=9)
    onnx.save(model, tmp_path / "height.onnx")
    keys = ["--set", f"infer.model={tmp_path / 'height.onnx'}", "--set", "infer.batch=100000"]
    call(ONNX_SEGMENTER, "run", "--recording", submaps, "--record", tmp_path / "out.mcap", *keys)
    columns = list(replica.open_recording(tmp_path / "out.mcap").messages("class"))
    assert len(columns) == 6
    for submap, column in zip(replica.open_recording(submaps).messages("submap"), columns, strict=True):
        assert np.array_equal(column["class_id"], submap["z"] > 1.0)
        assert column["score"].min() >= 127
    absent = call(ONNX_SEGMENTER, "run", "--recording", submaps, "--set", "infer.model=absent.onnx", code=78)
    assert "absent.onnx: no such file" in absent


def test_new_stage_in_python_passes_the_check_and_runs(tmp_path: Path, submaps):
    call("replica", "new-stage", "heights", "--lang", "python", "--out", tmp_path)
    shown = call("replica-launch", tmp_path / "heights/launch.toml", "--check", "--set", f"heights.python={sys.executable}")
    assert "no problems" in shown
    call(tmp_path / "heights/heights.py", "run", "--recording", submaps, "--record", tmp_path / "out.mcap")
    ground = replica.CLASS_NAMES.index("ground")
    columns = replica.open_recording(tmp_path / "out.mcap").messages("class")
    assert all(0 < (column["class_id"] == ground).sum() < len(column) for column in columns)
