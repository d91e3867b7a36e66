"""The data that Rerun reads from the files of `examples/python/to_rerun.py`."""

import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import PROGRAMS, ROOT, call, launch_file

import replica

chunk = pytest.importorskip("rerun.chunk")

TO_RERUN = ROOT / "examples/python/to_rerun.py"
#: Points of a submap that are shown at most.
MOST = 20_000


@pytest.fixture(scope="module")
def camera_drive(folder) -> Path:
    call("replica", "simulate", "--seed", "5", "--seconds", "3", "--rig", "kitti", "--out", folder / "camera_drive")
    return folder / "camera_drive"


@pytest.fixture(scope="module")
def recording(folder, camera_drive) -> Path:
    """A recording of all topics that are shown."""
    infer = f"program = '{PROGRAMS / 'height-segmenter'}'\n[instance]\n[colorize]"
    topics = "submap,color,class,instance,sweep,image,trajectory,gnss"
    path = launch_file(folder, camera_drive, "recorded", infer)
    call("replica-launch", path, "--record", folder / "recorded.mcap", "--topics", topics)
    return folder / "recorded.mcap"


@pytest.fixture(scope="module")
def found(folder, camera_drive, recording) -> dict[tuple[str, str], list[tuple[int | None, np.ndarray]]]:
    """By entity and component: time (ns since the Unix epoch; static: None) and values of each row, in the order of time."""
    file, components = folder / "recorded.rrd", {}
    call(TO_RERUN, recording, "--out", file, "--drive", camera_drive, "--points", str(MOST))
    for part in chunk.RrdReader(file).stream().to_chunks():
        batch = part.to_record_batch()
        times = [None] * len(batch) if part.is_static else batch["time"].cast("int64").to_pylist()
        for name in set(batch.schema.names) - {"rerun.controls.RowId", "time"}:
            rows = [(time, values(row)) for time, row in zip(times, batch[name], strict=True) if row.is_valid]
            components.setdefault((part.entity_path, name), []).extend(rows)
    return {key: sorted(rows, key=lambda row: row[0] or 0) for key, rows in components.items()}


def values(row) -> np.ndarray:
    """The numbers of a list of Arrow; of a list of vectors, a row for each."""
    numbers = row.values
    if hasattr(numbers.type, "list_size"):
        return numbers.flatten().to_numpy(zero_copy_only=False).reshape(len(numbers), -1)
    return numbers.to_numpy(zero_copy_only=False)


def messages(recording: Path, topic: str) -> list[replica.Message]:
    return list(replica.open_recording(recording).messages(topic))


def shown(message: replica.Message) -> np.ndarray:
    return message.rows[:: -(-len(message) // MOST) | 1]


def xyz(points: np.ndarray) -> np.ndarray:
    return np.stack([points[axis] for axis in "xyz"], axis=1)


def test_rerun_reads_every_shown_point_with_its_columns(found, recording):
    submaps, *columns = (messages(recording, topic) for topic in ("submap", "color", "class", "instance"))
    assert len(submaps) >= 2
    for submap, *of_submap in zip(submaps, *columns, strict=True):
        points, (color, of_class, instance) = shown(submap), map(shown, of_submap)

        def only(component):
            [(time, numbers)] = found[f"/odom/points/submap_{submap.seq}", component]
            assert time == submap.stamp
            return numbers

        assert MOST / 2 < len(points) <= MOST
        assert np.array_equal(only("Points3D:positions"), xyz(points))
        assert np.array_equal(only("Points3D:class_ids"), of_class["class_id"])
        assert np.array_equal(only("score"), of_class["score"])
        assert np.array_equal(only("instance"), instance)
        assert np.array_equal(only("intensity"), points["intensity"])
        seen = color["camera"] != 255
        rgb = sum(color[channel].astype("u4") << shift for channel, shift in (("r", 24), ("g", 16), ("b", 8))) | 255
        assert 0 < seen.sum() < len(seen) and np.array_equal(only("Points3D:colors"), np.where(seen, rgb, 0x969696FF))
        placed = submap.header["odom_from_submap"]
        assert np.array_equal(only("Transform3D:translation")[0], placed["translation"].astype("f4"))


def test_rerun_reads_every_sweep_pose_image_and_fix(found, camera_drive, recording):
    sweeps = found["/odom/lidar", "Points3D:positions"]
    assert [(time, len(points)) for time, points in sweeps] == [(sweep.stamp, len(sweep)) for sweep in messages(recording, "sweep")]
    assert {time for time, _ in sweeps} == {time for time, _ in found["/odom/lidar", "Transform3D:translation"]}
    poses = np.concatenate([message.rows for message in messages(recording, "trajectory")])
    body = found["/odom/body", "Transform3D:translation"]
    assert [time for time, _ in body] == poses["stamp"].tolist()
    assert np.array_equal([place[0] for _, place in body], poses["odom_from_body"]["translation"].astype("f4"))
    images = {entity: len(rows) for (entity, component), rows in found.items() if component == "EncodedImage:blob"}
    assert sum(images.values()) == len(messages(recording, "image")) > 0
    assert all((entity, "Pinhole:image_from_camera") in found for entity in images)
    fixes = np.concatenate([message.rows for message in messages(recording, "gnss")])
    places = np.array([place[0] for _, place in found["/fix", "GeoPoints:positions"]])
    assert np.array_equal(places, np.stack([fixes["latitude_deg"], fixes["longitude_deg"]], axis=1))


def test_boxes_in_rerun_are_the_tight_boxes_of_their_instances(found, recording):
    n_boxes = 0
    for submap, column in zip(messages(recording, "submap"), messages(recording, "instance"), strict=True):
        points, instances, pose = shown(submap), shown(column), submap.header["odom_from_submap"]
        in_odom = xyz(points).astype("f8") @ rotation(*pose["rotation"]).T + pose["translation"]
        for instance in np.unique(instances[instances != 0]):
            entity = f"/odom/objects/{instance}"
            box = {name: dict(found[entity, f"Boxes3D:{name}"])[submap.stamp][0] for name in ("centers", "half_sizes", "quaternions")}
            in_box = (in_odom[instances == instance] - box["centers"]) @ rotation(*box["quaternions"])
            # Up to the rounding of float32; flat boxes are 5 cm thick.
            assert np.allclose(abs(in_box).max(axis=0).clip(min=0.025), box["half_sizes"], atol=2e-4)
            n_boxes += 1
    assert n_boxes > 3


def rotation(x, y, z, w) -> np.ndarray:
    """The matrix of a quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_recording_gives_the_same_rerun_content_again_and_an_existing_file_is_kept(tmp_path, submaps):
    first, second = tmp_path / "a.rrd", tmp_path / "b.rrd"
    for file in (first, second):
        call(TO_RERUN, submaps, "--out", file, "--points", "1000")
    rerun = Path(sys.executable).with_name("rerun")
    call(rerun, "rrd", "verify", first)
    call(rerun, "rrd", "compare", "--unordered", first, second)
    before = first.read_bytes()
    assert "a.rrd: exists" in call(TO_RERUN, submaps, "--out", first, code=1)
    assert first.read_bytes() == before
