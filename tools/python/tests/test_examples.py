"""Examples and new stages work as they are."""

import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import PROGRAMS, ROOT, call, launch_file

import replica

ONNX_SEGMENTER = ROOT / "examples/python/onnx_segmenter.py"
TO_RERUN = ROOT / "examples/python/to_rerun.py"


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


@pytest.fixture(scope="module")
def camera_drive(folder):
    call("replica", "simulate", "--seed", "5", "--seconds", "3", "--rig", "kitti", "--out", folder / "camera_drive")
    return folder / "camera_drive"


@pytest.fixture(scope="module")
def recording(folder, camera_drive):
    """All topics that Rerun shows."""
    infer = f"program = '{PROGRAMS / 'height-segmenter'}'\n[instance]\n[colorize]"
    topics = "submap,color,class,instance,sweep,image,trajectory,gnss"
    call("replica-launch", launch_file(folder, camera_drive, "recorded", infer), "--record", folder / "recorded.mcap", "--topics", topics)
    return folder / "recorded.mcap"


def components(file) -> dict[tuple[str, str], list[tuple[int | None, object]]]:
    """What Rerun reads: by entity and component, the time (ns; static: None) and Arrow list of each row, in the order of time."""
    found: dict = {}
    for chunk in pytest.importorskip("rerun.chunk").RrdReader(file).stream().to_chunks():
        batch = chunk.to_record_batch()
        times = [None] * len(batch) if chunk.is_static else batch["time"].cast("int64").to_pylist()
        for name in set(batch.schema.names) - {"rerun.controls.RowId", "time"}:
            rows = [(time, row.values) for time, row in zip(times, batch[name], strict=True) if row.is_valid]
            found.setdefault((chunk.entity_path, name), []).extend(rows)
    return {key: sorted(rows, key=lambda row: row[0] or 0) for key, rows in found.items()}


def numbers(values) -> np.ndarray:
    """An Arrow list as rows of numbers."""
    inner = values.flatten() if hasattr(values.type, "list_size") else values
    return inner.to_numpy(zero_copy_only=False).reshape(len(values), -1)


def test_rerun_reads_the_points_poses_and_images_of_a_recording(tmp_path, camera_drive, recording):
    pytest.importorskip("rerun")
    most = 20_000
    call(TO_RERUN, recording, "--out", tmp_path / "a.rrd", "--drive", camera_drive, "--points", str(most))
    found = components(tmp_path / "a.rrd")
    kept = {topic: list(replica.open_recording(recording).messages(topic)) for topic in ("submap", "color", "class", "instance", "sweep", "image")}
    assert len(kept["submap"]) >= 4 and len(kept["image"]) > 0
    for submap, *columns in zip(*(kept[topic] for topic in ("submap", "color", "class", "instance")), strict=True):
        color, of_class, instance = (column.rows[:: -(-len(submap) // most)] for column in columns)
        shown = submap.rows[:: -(-len(submap) // most)]

        def only(component):
            [(time, values)] = found[f"/odom/points/submap_{submap.seq}", component]
            assert time == submap.stamp
            return numbers(values)

        assert most / 2 < len(shown) <= most
        assert np.array_equal(only("Points3D:positions"), np.stack([shown[axis] for axis in "xyz"], axis=1))
        assert np.array_equal(only("Points3D:class_ids")[:, 0], of_class["class_id"])
        assert np.array_equal(only("instance")[:, 0], instance)
        assert np.array_equal(only("intensity")[:, 0], shown["intensity"])
        assert np.array_equal(only("score")[:, 0], of_class["score"])
        seen = color["camera"] != 255
        rgb = np.where(seen, color["r"].astype("u4") << 24 | color["g"].astype("u4") << 16 | color["b"].astype("u4") << 8 | 255, 0x969696FF)
        assert 0 < seen.sum() < len(seen) and np.array_equal(only("Points3D:colors")[:, 0], rgb)
        placed = submap.header["world_from_submap"]
        assert np.array_equal(only("Transform3D:translation")[0], placed["translation"].astype("f4"))
    sweeps = found["/odom/lidar", "Points3D:positions"]
    assert [(time, len(values)) for time, values in sweeps] == [(sweep.stamp, len(sweep)) for sweep in kept["sweep"]]
    poses = np.concatenate([message.rows for message in replica.open_recording(recording).messages("trajectory")])
    body = found["/odom/body", "Transform3D:translation"]
    assert [time for time, _ in body] == poses["stamp"].tolist()
    assert np.array_equal([numbers(row)[0] for _, row in body], poses["world_from_body"]["translation"].astype("f4"))
    images = [key for key in found if key[1] == "EncodedImage:blob"]
    assert sum(len(found[key]) for key in images) == len(kept["image"])
    assert all((entity, "Pinhole:image_from_camera") in found for entity, _ in images)


def test_boxes_in_rerun_hold_the_points_of_their_instance(tmp_path, recording):
    pytest.importorskip("rerun")
    call(TO_RERUN, recording, "--out", tmp_path / "a.rrd")
    found, n_boxes = components(tmp_path / "a.rrd"), 0
    for submap, column in zip(*(replica.open_recording(recording).messages(topic) for topic in ("submap", "instance")), strict=True):
        t, (x, y, z, w) = submap.header["world_from_submap"]
        assert max(abs(x), abs(y)) < 0.05, "the drive is level"
        for instance in np.unique(column.rows[column.rows != 0]):
            box = {name: numbers(dict(found[f"/odom/objects/{instance}", f"Boxes3D:{name}"])[submap.stamp])[0] for name in ("centers", "half_sizes", "quaternions")}
            points = submap.rows[:: -(-len(submap) // 400_000)][column.rows[:: -(-len(submap) // 400_000)] == instance]
            if not len(points):
                continue
            in_odom = np.stack([points[axis] for axis in "xyz"], axis=1) @ rotation(x, y, z, w).T + t
            in_box = (in_odom - box["centers"]) @ rotation(*box["quaternions"])
            # Up to the rounding of float32, and no larger than needed.
            assert np.allclose(abs(in_box).max(axis=0).clip(min=0.025), box["half_sizes"], atol=2e-4)
            n_boxes += 1
    assert n_boxes > 3


def rotation(x, y, z, w) -> np.ndarray:
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_recording_gives_the_same_rerun_content_again_and_an_existing_file_is_kept(tmp_path, submaps):
    pytest.importorskip("rerun")
    for name in ("a.rrd", "b.rrd"):
        call(TO_RERUN, submaps, "--out", tmp_path / name, "--points", "1000")
    call(Path(sys.executable).with_name("rerun"), "rrd", "compare", "--unordered", tmp_path / "a.rrd", tmp_path / "b.rrd")
    before = (tmp_path / "a.rrd").read_bytes()
    assert "a.rrd: exists" in call(TO_RERUN, submaps, "--out", tmp_path / "a.rrd", code=1)
    assert (tmp_path / "a.rrd").read_bytes() == before
