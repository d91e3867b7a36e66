"""Runs, recordings and running pipelines as arrays."""

import json
import subprocess

import numpy as np
import pytest
from conftest import HEIGHT_SEGMENTER, PROGRAMS, call, launch_file, python_stage

import replica
from replica._layouts import dtypes, tables


def test_dtypes_have_the_size_of_every_topic():
    for topic, table in tables().items():
        header, row = dtypes(topic)
        assert (header.itemsize, row.itemsize) == (table["header_bytes"], table["row_bytes"]), topic
    header, _ = dtypes("submap")
    assert header["sweeps"].shape == (256,) and header["sweeps"].base["submap_from_lidar_begin"].shape == (7,)


def test_recording_has_its_messages_with_header_and_rows(submaps):
    recording = replica.open_recording(submaps)
    assert "submap" in recording.topics and recording.about["stage"] == "slam_aggregate"
    kept = list(recording.messages("submap"))
    assert [message.seq for message in kept] == [0, 1, 2, 3, 4, 5]
    for message in kept:
        header = message.header
        xyz = np.stack([message[axis] for axis in "xyz"])
        assert len(message) > 1000 and np.array_equal(xyz.min(axis=1), header["min"]) and message.stamp == header["stamp_begin"]
        assert header["sweeps"]["n_points"][: header["n_sweeps"]].sum() == len(message)
    with pytest.raises(ValueError, match="has no topic color; it has"):
        next(recording.messages("color"))


def test_submaps_are_joined_with_later_columns_before_and_after_a_restart(folder, submaps):
    call(HEIGHT_SEGMENTER, "run", "--recording", submaps, "--record", folder / "columns.mcap")
    points = list(replica.open_recording(submaps).messages("submap"))
    columns = list(replica.open_recording(folder / "columns.mcap").messages("class"))
    join = replica.SubmapJoin("class")
    assert join.save() == b"" and not list(join.complete({"submap": points[:2], "class": []}))
    joined = list(join.complete({"submap": [], "class": columns[:1]}))
    restarted = replica.SubmapJoin("class")
    restarted.restore(join.save())
    joined += restarted.complete({"submap": points[2:3], "class": columns[1:3]})
    assert [(submap.seq, others["class"].seq) for submap, others in joined] == [(0, 0), (1, 1), (2, 2)]
    assert all(np.array_equal(submap.rows, points[submap.seq].rows) for submap, _ in joined)
    with pytest.raises(ValueError, match="<class 4: .* arrived when the column of <submap 3: .* was due"):
        list(restarted.complete({"submap": points[3:4], "class": columns[4:5]}))


@pytest.fixture(scope="module")
def finished(folder, drive):
    path = launch_file(folder, drive, "finished", python_stage(HEIGHT_SEGMENTER))
    call("replica-launch", path)
    return folder / "finished"


def test_run_has_clouds_trajectory_and_summary(finished):
    run = replica.open_run(finished)
    clouds = list(run.clouds)
    assert sum(len(cloud.points) for cloud in clouds) == run.index["n_points"] == run.summary["total"]["points"]
    assert {"x", "y", "z", "semantic"} <= set(clouds[0].points.dtype.names) and not clouds[0].points.flags.writeable
    assert any(line.startswith("frame ") for line in clouds[0].info)
    norms = np.linalg.norm(run.trajectory["rotation"], axis=1)
    assert len(run.trajectory) > 50 and np.allclose(norms, 1.0) and np.all(np.diff(run.trajectory["stamp_s"]) > 0)


def test_folder_without_a_run_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="is not the output of a run"):
        replica.open_run(tmp_path)
    (tmp_path / "a.ply").write_bytes(b"solid\n")
    with pytest.raises(ValueError, match="is not a line of a PLY header"):
        replica.read_ply(tmp_path / "a.ply")


def test_observer_receives_every_submap_of_a_running_pipeline_and_changes_nothing(folder, drive, finished):
    path = launch_file(folder, drive, "observed", python_stage(HEIGHT_SEGMENTER))
    running = subprocess.Popen([PROGRAMS / "replica-launch", path], stderr=subprocess.PIPE)
    n_points = {message.seq: len(message) for message in replica.observe(folder / "observed", "submap", lossless=True)}
    assert running.wait() == 0, running.stderr.read().decode()
    index = json.loads((folder / "observed/clouds/index.json").read_text())
    expected = {cloud["seq"]: cloud["n_points"] for cloud in index["clouds"]}
    assert len(n_points) >= 4 and n_points.items() <= expected.items()
    for cloud in (finished / "clouds").iterdir():
        assert cloud.read_bytes() == (folder / "observed/clouds" / cloud.name).read_bytes()


def test_observer_that_keeps_too_many_arrays_is_told_the_rule(folder, drive):
    path = launch_file(folder, drive, "kept_by_observer", python_stage(HEIGHT_SEGMENTER))
    running = subprocess.Popen([PROGRAMS / "replica-launch", path], stderr=subprocess.DEVNULL)
    with pytest.raises(BufferError, match="at most 2 are allowed; keep copies"):
        kept = [message["x"] for message in replica.observe(folder / "kept_by_observer", "submap", lossless=True)]
        assert not kept, "the observer must fail before the end"
    assert running.wait() == 0
