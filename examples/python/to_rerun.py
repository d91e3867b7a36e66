#!/usr/bin/env python3
"""Converts a recording for the Rerun viewer.

  pip install rerun-sdk                                                  # the viewer comes with it
  to_rerun.py run.mcap --out run.rrd --drive drives/sample && rerun run.rrd

| entity | archetype | from topic |
|---|---|---|
| `odom/points/submap_0` ... | `Points3D` with class ids; per point `instance`, `score`, `intensity`, `moving` | `submap`, `color`, `class`, `instance` |
| `odom/objects/7` ... | `Boxes3D` around the shown points of an instance | `submap`, `class`, `instance` |
| `odom/lidar`, `odom/lidar_1` ... | `Transform3D`, `Points3D` gray by intensity | `submap`, `sweep` |
| `odom/body`, `odom/path` | `Transform3D`, `LineStrips3D` | `trajectory` |
| `odom/body/camera_0` ... | `EncodedImage`; with `--drive`, `Transform3D` and `Pinhole` | `image` |
| `fix`, `fixes` | `GeoPoints`, `GeoLineStrings` | `gnss` |

`odom` is the frame of the odometry. The timeline `time` has the times of measurement.
"""

import argparse
import io
import sys
import tomllib
from datetime import timedelta
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from PIL import Image

import replica

TIMELINE = "time"
TOPICS = ("submap", "color", "class", "instance", "sweep", "image", "trajectory", "gnss")
CLASSES = dict(enumerate(replica.CLASS_NAMES))
GRAY, ORANGE = np.uint8([150, 150, 150]), [255, 165, 25]
#: Camera of a point that no camera sees; bit of the flags of a point on a moving object.
UNSEEN, MOVING = 255, 1
JPEG_QUALITY = 85
#: Smaller sides of boxes are drawn as long as this, m.
SMALLEST_M = 0.05


class Scene:
    """Shows the messages of a recording. Columns become components of their submap's entity, so they may come in any order."""

    def __init__(self, stream: rr.RecordingStream, topics: list[str], most_points: int):
        self.stream, self.most_points = stream, most_points
        #: Topics from which boxes of instances are made, and their received messages by submap.
        self.of_boxes = {"submap", "instance", "class"} & set(topics) if {"submap", "instance"} <= set(topics) else set()
        self.waiting: dict[int, dict[str, replica.Message]] = {}
        self.path, self.fixes = [], []
        self.submaps, self.cameras = set(), set()
        stream.log("odom", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.log("odom", rr.AnnotationContext(list(CLASSES.items())), static=True)

    def show(self, message: replica.Message):
        getattr(self, f"show_{message.topic}")(message)
        if message.topic in self.of_boxes:
            parts = self.waiting.setdefault(message.seq, {})
            parts[message.topic] = message
            if parts.keys() == self.of_boxes:
                del self.waiting[message.seq]
                self.show_boxes(parts["submap"], parts["instance"], parts.get("class"))

    def log(self, entity: str, stamp: int, *values):
        self.stream.set_time(TIMELINE, timestamp=np.datetime64(stamp, "ns"))
        self.stream.log(entity, *values)

    def shown(self, rows: np.ndarray) -> np.ndarray:
        """The rows of the shown points: of too many, every n-th. n is odd, because an even step would leave out whole beams."""
        return rows[:: -(-len(rows) // self.most_points) | 1]

    def show_submap(self, submap):
        points, (t, q) = self.shown(submap.rows), submap.header["odom_from_submap"]
        entity = submap_entity(submap.seq)
        self.submaps.add(entity)
        self.log(entity, submap.stamp, rr.Transform3D(translation=t, quaternion=q))
        values = rr.AnyValues(intensity=points["intensity"], moving=points["flags"] & MOVING != 0)
        self.log(entity, submap.stamp, rr.Points3D(xyz(points), radii=rr.Radius.ui_points(1.0)), values)
        for sweep in submap.header["sweeps"][: submap.header["n_sweeps"]]:
            in_submap = sweep["submap_from_lidar_begin"].astype("f8")
            pose = rr.Transform3D(translation=t + rotated(q, in_submap[:3]), quaternion=product(q, in_submap[3:]))
            self.log(lidar_entity(sweep["lidar"]), int(sweep["stamp"]), pose)

    def show_color(self, color):
        rows = self.shown(color.rows)
        rgb = np.stack([rows["r"], rows["g"], rows["b"]], axis=1)
        rgb[rows["camera"] == UNSEEN] = GRAY
        self.log(submap_entity(color.seq), color.stamp, rr.Points3D.from_fields(colors=rgb))

    def show_class(self, column):
        rows = self.shown(column.rows)
        values = rr.Points3D.from_fields(class_ids=rows["class_id"]), rr.AnyValues(score=rows["score"])
        self.log(submap_entity(column.seq), column.stamp, *values)

    def show_instance(self, column):
        self.log(submap_entity(column.seq), column.stamp, rr.AnyValues(instance=self.shown(column.rows)))

    def show_boxes(self, submap, instances, classes):
        """An upright box for each instance. An instance that continues in another submap gets the box of the later one."""
        t, q = submap.header["odom_from_submap"]
        points, ids = xyz(self.shown(submap.rows)), self.shown(instances.rows)
        for instance in np.unique(ids[ids != 0]):
            center, half_size, heading = box_around(points[ids == instance])
            label = str(instance)
            if classes is not None:
                most = int(np.bincount(self.shown(classes.rows)["class_id"][ids == instance]).argmax())
                label = f"{CLASSES.get(most, most)} {instance}"
            turn = product(q, np.array([0, 0, np.sin(heading / 2), np.cos(heading / 2)]))
            placed = {"centers": [t + rotated(q, center)], "half_sizes": [half_size], "quaternions": [turn]}
            box = rr.Boxes3D(**placed, labels=[label], show_labels=False, colors=[ORANGE])
            self.log(f"odom/objects/{instance}", submap.stamp, box)

    def show_sweep(self, sweep):
        gray = np.repeat(64 + (sweep["intensity"] * 0.75).astype("u1")[:, None], 3, axis=1)
        points = rr.Points3D(xyz(sweep.rows), colors=gray, radii=rr.Radius.ui_points(1.0))
        self.log(lidar_entity(sweep.header["lidar"]), sweep.stamp, points)

    def show_image(self, image):
        pixels = image.rows.reshape(image.header["height"], image.header["width"], image.header["channels"])
        file = io.BytesIO()
        Image.fromarray(pixels.squeeze()).save(file, "jpeg", quality=JPEG_QUALITY)
        camera = int(image.header["camera"])
        self.cameras.add(camera)
        self.log(camera_entity(camera), image.stamp, rr.EncodedImage(contents=file.getvalue(), media_type="image/jpeg"))

    def show_trajectory(self, trajectory):
        poses = trajectory["odom_from_body"]
        self.path.append(poses["translation"])
        columns = rr.Transform3D.columns(translation=poses["translation"], quaternion=poses["rotation"])
        self.stream.send_columns("odom/body", [times(trajectory["stamp"])], columns)

    def show_gnss(self, gnss):
        rows = gnss.rows[gnss["quality"] != 0]
        if len(rows):
            self.fixes.append(np.stack([rows["latitude_deg"], rows["longitude_deg"]], axis=1))
            self.stream.send_columns("fix", [times(rows["stamp"])], rr.GeoPoints.columns(positions=self.fixes[-1]))

    def show_cameras(self, drive: Path):
        """Poses of the cameras. Rerun has no lens distortion: with a wide lens, the corners are drawn at wrong positions."""
        for number, camera in enumerate(tomllib.loads((drive / "drive.toml").read_text()).get("camera", [])):
            pose, model = camera["body_from_camera"], camera["model"]
            pinhole = rr.Pinhole(
                focal_length=[model["fx"], model["fy"]],
                # Their centers are whole numbers in the drive folder, and halves in Rerun.
                principal_point=[model["cx"] + 0.5, model["cy"] + 0.5],
                resolution=[model["width"], model["height"]],
                camera_xyz=rr.ViewCoordinates.RDF,
            )
            placed = rr.Transform3D(translation=pose["translation"], quaternion=pose["rotation"])
            self.stream.log(camera_entity(number), placed, pinhole, static=True)

    def finish(self):
        if self.path:
            self.stream.log("odom/path", rr.LineStrips3D([np.concatenate(self.path)], radii=rr.Radius.ui_points(1.5)), static=True)
        if self.fixes:
            self.stream.log("fixes", rr.GeoLineStrings(lat_lon=[np.concatenate(self.fixes)]), static=True)
        self.stream.send_blueprint(blueprint(self.submaps, self.cameras, bool(self.fixes)))


def submap_entity(seq: int) -> str:
    return f"odom/points/submap_{seq}"


def camera_entity(number: int) -> str:
    return f"odom/body/camera_{number}"


def lidar_entity(number: int) -> str:
    return f"odom/lidar_{number}" if number else "odom/lidar"


def times(stamps: np.ndarray) -> rr.TimeColumn:
    return rr.TimeColumn(TIMELINE, timestamp=stamps.astype("datetime64[ns]"))


def xyz(points: np.ndarray) -> np.ndarray:
    return np.stack([points["x"], points["y"], points["z"]], axis=1)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Product of quaternions x y z w."""
    return np.append(a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3]), a[3] * b[3] - a[:3] @ b[:3])


def rotated(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A vector turned by a quaternion x y z w."""
    return v + 2 * np.cross(q[:3], np.cross(q[:3], v) + q[3] * v)


def box_around(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Center, half size (m) and heading (rad) of the upright box with the smallest base, among headings of whole degrees."""
    points = points.astype("f8")

    def turned(heading: float) -> np.ndarray:
        """For rows of x and y."""
        return np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])

    headings = np.radians(np.arange(90))
    best = min(headings, key=lambda heading: np.prod(np.ptp(points[:, :2] @ turned(-heading), axis=0)))
    in_box = np.column_stack([points[:, :2] @ turned(-best), points[:, 2]])
    low, high = in_box.min(axis=0), in_box.max(axis=0)
    middle = (low + high) / 2
    return np.append(middle[:2] @ turned(best), middle[2]), np.maximum(high - low, SMALLEST_M) / 2, best


def blueprint(submaps: set[str], cameras: set[int], has_fixes: bool) -> rrb.Blueprint:
    """Views: the points by color and by class, the images, the fixes on a map."""
    by_class = rr.Points3D.from_fields().visualizer(
        mappings=[rrb.encodings.VisualizerComponentMapping("Points3D:colors", rrb.encodings.ComponentSourceKind.AnnotationContext)]
    )
    # Behind and above the first position of the vehicle, which faces x.
    eye = rrb.EyeControls3D(position=[-25.0, -20.0, 25.0], look_target=[15.0, 0.0, 0.0])
    views = rrb.Tabs(
        rrb.Spatial3DView(origin="odom", name="color", eye_controls=eye),
        rrb.Spatial3DView(origin="odom", name="class", eye_controls=eye, overrides=dict.fromkeys(sorted(submaps), by_class)),
    )
    images = [rrb.Spatial2DView(origin=camera_entity(camera), name=f"camera {camera}") for camera in sorted(cameras)]
    side = ([rrb.Grid(*images)] if images else []) + ([rrb.MapView(origin="/", name="fixes")] if has_fixes else [])
    shown = rrb.Horizontal(views, rrb.Vertical(*side), column_shares=[2, 1]) if side else views
    return rrb.Blueprint(shown, rrb.TimePanel(timeline=TIMELINE, state="collapsed"), collapse_panels=True)


def convert(recording: replica.Recording, out: Path, drive: Path | None, points: int) -> int:
    """Converts the recording. Returns the number of messages shown."""
    topics = [topic for topic in TOPICS if topic in recording.topics]
    if not topics:
        raise ValueError(f"{recording.path}: contains no topic of {', '.join(TOPICS)}")
    if out.exists():
        raise FileExistsError(f"{out}: exists")
    # The same recording gives the same content: no time of the conversion, no random id, no chunks that end by the
    # clock.
    chunks = rr.ChunkBatcherConfig.DEFAULT()
    chunks.flush_tick = timedelta(days=1)
    stream = rr.RecordingStream("replica", recording_id=recording.path.stem, send_properties=False, batcher_config=chunks)
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.save(out)
    scene, n = Scene(stream, topics, points), 0
    if drive is not None:
        scene.show_cameras(drive)
    # A truncated recording is shown up to its end.
    try:
        for n, message in enumerate(recording.messages(*topics), 1):
            scene.show(message)
    finally:
        scene.finish()
        stream.flush()
    return n


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path, help="recording of `replica record` or `replica-launch --record`")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="file for Rerun; must not exist")
    parser.add_argument("--drive", type=Path, metavar="DIR", help="drive folder with the poses of the cameras")
    parser.add_argument("--points", type=int, default=400_000, metavar="N", help="maximum number of shown points of a submap (default: 400000)")
    args = parser.parse_args()
    try:
        n = convert(replica.open_recording(args.recording), args.out, args.drive, args.points)
    except (OSError, ValueError) as error:
        sys.exit(f"error: {error}")
    print(f"{args.out}: {n} messages")
