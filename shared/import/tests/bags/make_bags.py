"""Writes the bags of this folder with the Python package rosbags 0.11 (https://pypi.org/project/rosbags).

    python -m venv venv && venv/bin/pip install rosbags==0.11.9 && venv/bin/python make_bags.py OUT

All bags have the same three revolutions of a sensor with 16 beams at 10 Hz, as different drivers write them. `street` also has other
sensors in every container. The expected imports are in ../suite/ros.rs.
"""

import struct
import sys
import zlib
from functools import reduce
from math import cos, pi, radians, sin
from operator import xor
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

BEGIN = 1_700_000_000_000_000_000
TURN = 100_000_000
BEAMS, COLUMNS, SWEEPS = 16, 8, 3

LIVOX = """std_msgs/Header header
uint64 timebase
uint32 point_num
uint8 lidar_id
uint8[3] rsvd
livox_ros_driver2/CustomPoint[] points
"""
LIVOX_POINT = "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n"
SENTENCE = "std_msgs/Header header\nstring sentence\n"


def typestore(store):
    types = get_typestore(store)
    for name, text in [
        ("livox_ros_driver2/msg/CustomPoint", LIVOX_POINT),
        ("livox_ros_driver2/msg/CustomMsg", LIVOX),
        ("nmea_msgs/msg/Sentence", SENTENCE),
        ("tf2_msgs/msg/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"),
    ]:
        types.register(get_types_from_msg(text, name))
    return types


class Messages:
    """Messages of one ROS version."""

    def __init__(self, store):
        self.types = typestore(store)
        self.is_ros1 = store == Stores.ROS1_NOETIC

    def make(self, kind_name, /, **values):
        kind = self.types.types[kind_name]
        if kind_name == "std_msgs/msg/Header" and self.is_ros1:
            values["seq"] = 7
        if kind_name == "sensor_msgs/msg/CameraInfo" and self.is_ros1:
            values = {(key.upper() if key in "dkrp" else key): value for key, value in values.items()}
        return kind(**values)

    def header(self, nanos, frame):
        stamp = self.make("builtin_interfaces/msg/Time", sec=nanos // 10**9, nanosec=nanos % 10**9)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def vector(self, x, y, z):
        return self.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)

    def quaternion(self, x, y, z, w):
        return self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)


def points():
    """Column, beam, position, and time after the start of the revolution (ns) in firing order."""
    for column in range(COLUMNS):
        for beam in range(BEAMS):
            elevation = radians(2.0 * beam - 15.0)
            azimuth = -2.0 * pi * (column + 0.125) / COLUMNS
            r = 10.0 + 0.5 * column
            position = (r * cos(elevation) * cos(azimuth), r * cos(elevation) * sin(azimuth), r * sin(elevation))
            yield column, beam, position, column * (TURN // COLUMNS) + beam * 2000


def cloud(m, stamp, frame, fields, rows, height=1, big=False):
    """`fields`: name, offset, datatype. `rows`: bytes of the points."""
    data = b"".join(rows)
    step = len(rows[0])
    make = lambda name, offset, datatype: m.make("sensor_msgs/msg/PointField", name=name, offset=offset, datatype=datatype, count=1)
    return m.make(
        "sensor_msgs/msg/PointCloud2",
        header=m.header(stamp, frame),
        height=height,
        width=len(rows) // height,
        fields=[make(*field) for field in fields],
        is_bigendian=big,
        point_step=step,
        row_step=step * len(rows) // height,
        data=np.frombuffer(data, dtype=np.uint8),
        is_dense=False,
    )


XYZ = [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)]


def velodyne(m, sweep):
    """The stamp belongs to the last point, times are s before it. The intensity is 10 times the column."""
    begin = BEGIN + sweep * TURN
    last = max(time for *_, time in points())
    rows = [struct.pack("<3ffHf", *p, 10.0 * column, beam, (time - last) * 1e-9) for column, beam, p, time in points()]
    fields = XYZ + [("intensity", 12, 7), ("ring", 16, 4), ("time", 18, 7)]
    return cloud(m, begin + last, "velodyne", fields, rows)


def ouster(m, sweep):
    """A row per beam, from the highest; missing returns are 0 0 0; the intensity is above 255, the reflectivity is not."""
    rows = []
    for ring in range(BEAMS):
        of_beam = [point for point in points() if point[1] == BEAMS - 1 - ring]
        for column, _, p, time in of_beam:
            p = (0.0, 0.0, 0.0) if (ring, column) == (0, 0) else p
            rows.append(struct.pack("<3fIHBx", *p, time, 10 * column, ring))
    fields = XYZ + [("t", 12, 6), ("reflectivity", 16, 4), ("ring", 18, 2)]
    return cloud(m, BEGIN + sweep * TURN, "os_sensor", fields, rows, height=BEAMS)


def hesai(m, sweep):
    """Big-endian; times since 1970 in s; a NaN for a missing return; another order of the fields."""
    begin = BEGIN + sweep * TURN
    rows = []
    for column, beam, p, time in points():
        p = (float("nan"),) * 3 if (beam, column) == (3, 1) else p
        rows.append(struct.pack(">dHf3f", (begin + time) / 10**9, BEAMS - 1 - beam, 10.0 * column, *p))
    fields = [("timestamp", 0, 8), ("ring", 8, 4), ("intensity", 10, 7), ("x", 14, 7), ("y", 18, 7), ("z", 22, 7)]
    return cloud(m, begin, "hesai_lidar", fields, rows, big=True)


def livox_cloud(m, sweep):
    """Times since 1970 in ns as f64; lines that are not rings."""
    begin = BEGIN + sweep * TURN
    rows = [
        struct.pack("<3ffBBd", *p, 10.0 * column, 0, (beam + column) % 4, float(begin + time))
        for column, beam, p, time in points()
    ]
    fields = XYZ + [("intensity", 12, 7), ("tag", 16, 2), ("line", 17, 2), ("timestamp", 18, 8)]
    return cloud(m, begin, "livox_frame", fields, rows)


def untimed(m, sweep):
    rows = [struct.pack("<3f", *p) for *_, p, _ in points()]
    return cloud(m, BEGIN + sweep * TURN, "velodyne", XYZ, rows)


def livox_custom(m, sweep):
    make = lambda column, beam, p, time: m.make(
        "livox_ros_driver2/msg/CustomPoint",
        offset_time=time, x=p[0], y=p[1], z=p[2], reflectivity=10 * column, tag=0, line=(beam + column) % 4,
    )
    begin = BEGIN + sweep * TURN
    return m.make(
        "livox_ros_driver2/msg/CustomMsg",
        header=m.header(begin, "livox_frame"),
        timebase=begin,
        point_num=BEAMS * COLUMNS,
        lidar_id=0,
        rsvd=np.zeros(3, dtype=np.uint8),
        points=[make(*point) for point in points()],
    )


def bayer(m, stamp):
    """8 x 6 pixels of red 200, green 100, blue 50; rows of 10 bytes."""
    even, odd = [200, 100] * 4 + [0, 0], [100, 50] * 4 + [0, 0]
    data = np.array((even + odd) * 3, dtype=np.uint8)
    return m.make(
        "sensor_msgs/msg/Image", header=m.header(stamp, "camera_optical"), height=6, width=8, encoding="bayer_rggb8",
        is_bigendian=0, step=10, data=data,
    )


def png():
    """A gray PNG of 4 x 2 pixels."""
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    head = struct.pack(">IIBBBBB", 4, 2, 8, 0, 0, 0, 0)
    rows = b"\x00\x01\x02\x03\x04\x00\x05\x06\x07\x08"
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def camera_info(m, stamp, width, height):
    roi = m.make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    row = lambda *values: np.array(values, dtype=np.float64)
    return m.make(
        "sensor_msgs/msg/CameraInfo", header=m.header(stamp, "camera_optical"), height=height, width=width,
        distortion_model="plumb_bob", d=row(-0.1, 0.02, 0.001, -0.001, 0.0),
        k=row(8.0, 0, 3.5, 0, 8.5, 2.5, 0, 0, 1), r=row(1, 0, 0, 0, 1, 0, 0, 0, 1),
        p=row(7.0, 0, 3.5, 0, 0, 7.5, 2.5, 0, 0, 0, 1, 0), binning_x=0, binning_y=0, roi=roi,
    )


def imu(m, number):
    row = lambda value: np.full(9, value, dtype=np.float64)
    return m.make(
        "sensor_msgs/msg/Imu", header=m.header(BEGIN + number * 10_000_000, "imu_link"),
        orientation=m.quaternion(0.0, 0.0, 0.0, 1.0), orientation_covariance=row(-1.0),
        angular_velocity=m.vector(0.01, 0.02, 0.03 + number), angular_velocity_covariance=row(0.0),
        linear_acceleration=m.vector(0.1, 0.2, 9.81), linear_acceleration_covariance=row(0.0),
    )


def fix(m, number):
    status = m.make("sensor_msgs/msg/NavSatStatus", status=-1 if number == 0 else 2, service=1)
    return m.make(
        "sensor_msgs/msg/NavSatFix", header=m.header(BEGIN + number * 50_000_000, "gnss"), status=status,
        latitude=48.85 + number * 1e-5, longitude=2.35, altitude=104.5,
        position_covariance=np.zeros(9), position_covariance_type=0,
    )


def transform(m, parent, child, xyz, q, stamp=BEGIN):
    return m.make(
        "geometry_msgs/msg/TransformStamped", header=m.header(stamp, parent), child_frame_id=child,
        transform=m.make("geometry_msgs/msg/Transform", translation=m.vector(*xyz), rotation=m.quaternion(*q)),
    )


def tf_static(m):
    make = lambda *values: transform(m, *values)
    upright = (0.0, 0.0, 0.0, 1.0)
    return m.make("tf2_msgs/msg/TFMessage", transforms=[
        make("base_link", "mast", (0.5, 0.0, 1.0), upright),
        make("mast", "velodyne", (0.0, 0.0, 0.9), upright),
        make("mast", "camera_optical", (0.2, 0.0, 0.0), (-0.5, 0.5, -0.5, 0.5)),
        make("base_link", "imu_link", (0.0, 0.0, 0.3), (1.0, 0.0, 0.0, 0.0)),
        make("base_link", "gnss", (-0.4, 0.0, 1.5), upright),
    ])


def street(m):
    """Topic, type, time of reception, message."""
    # Late: the import needs the transforms at the end only.
    yield "/tf_static", "tf2_msgs/msg/TFMessage", BEGIN + 2, tf_static(m)
    for sweep in range(SWEEPS):
        at = BEGIN + (sweep + 1) * TURN
        yield "/velodyne_points", "sensor_msgs/msg/PointCloud2", at, velodyne(m, sweep)
        yield "/cam/camera_info", "sensor_msgs/msg/CameraInfo", at + 1, camera_info(m, at, 8, 6)
        # Without a stamp.
        yield "/cam/image_raw", "sensor_msgs/msg/Image", at + 1, bayer(m, 0)
    for number in range(6):
        yield "/imu/data", "sensor_msgs/msg/Imu", BEGIN + number * 10_000_000 + 500, imu(m, number)
    for number in range(4):
        yield "/fix", "sensor_msgs/msg/NavSatFix", BEGIN + number * 50_000_000 + 900, fix(m, number)
    yield "/chatter", "std_msgs/msg/String", BEGIN, m.make("std_msgs/msg/String", data="hello")


def split(is_late):
    """The messages of `street` before or after the second revolution."""
    return lambda m: (one for one in street(m) if (one[2] >= BEGIN + 2 * TURN) == is_late)


def moving(m):
    """All transforms on /tf: the vehicle drives, the LiDAR is fixed but for rounding, a turret with a camera turns. A second camera
    next to the LiDAR has images of 16 bits."""
    for sweep in range(SWEEPS):
        at = BEGIN + (sweep + 1) * TURN
        yaw = lambda angle: (0.0, 0.0, sin(angle / 2), cos(angle / 2))
        upright = (0.0, 0.0, 0.0, 1.0)
        yield "/tf", "tf2_msgs/msg/TFMessage", at, m.make("tf2_msgs/msg/TFMessage", transforms=[
            transform(m, "odom", "base_link", (1.0 * sweep, 0.0, 0.0), yaw(0.1 * sweep), at),
            transform(m, "base_link", "velodyne", (0.5, 2e-4 * sweep, 1.9), yaw(2e-4 * sweep), at),
            transform(m, "base_link", "camera_optical", (0.7, 0.0, 1.0), (-0.5, 0.5, -0.5, 0.5), at),
            transform(m, "base_link", "turret", (0.0, 0.0, 2.0), yaw(0.5 * sweep), at),
            transform(m, "turret", "turret_optical", (0.0, 0.0, 0.1), upright, at),
        ])
        yield "/velodyne_points", "sensor_msgs/msg/PointCloud2", at, velodyne(m, sweep)
        for name, frame, encoding, value in [
            ("gray", "camera_optical", "mono16", struct.pack("<H", 25_700)),
            ("turret", "turret_optical", "yuv422_yuy2", bytes([81, 90])),
        ]:
            info = camera_info(m, at, 8, 6)
            image = m.make(
                "sensor_msgs/msg/Image", header=m.header(at, frame), height=6, width=8, encoding=encoding, is_bigendian=0, step=16,
                data=np.frombuffer(value * 48, dtype=np.uint8),
            )
            yield f"/{name}/camera_info", "sensor_msgs/msg/CameraInfo", at, info
            yield f"/{name}/image_raw", "sensor_msgs/msg/Image", at, image


def two_lidars(m):
    """Clouds of two LiDARs, and filtered ones of the first."""
    upright = (0.0, 0.0, 0.0, 1.0)
    yield "/tf_static", "tf2_msgs/msg/TFMessage", BEGIN, m.make("tf2_msgs/msg/TFMessage", transforms=[
        transform(m, "base_link", "front", (0.6, 0.0, 1.2), upright),
        transform(m, "base_link", "rear", (-1.4, 0.0, 1.3), (0.0, 0.0, 1.0, 0.0)),
    ])
    for sweep in range(SWEEPS):
        for topic, frame in [("/front/points", "front"), ("/front/filtered", "front"), ("/rear/points", "rear")]:
            message = velodyne(m, sweep)
            message.header.frame_id = frame
            yield topic, "sensor_msgs/msg/PointCloud2", BEGIN + (sweep + 1) * TURN, message


def cameras(m):
    """Two cameras in addition to clouds without transforms, and a receiver's sentences."""
    for sweep in range(2):
        yield "/points", "sensor_msgs/msg/PointCloud2", BEGIN + sweep * TURN, untimed(m, sweep)
    image = m.make(
        "sensor_msgs/msg/CompressedImage", header=m.header(BEGIN + 5, "camera_optical"), format="mono8; png compressed ",
        data=np.frombuffer(png(), dtype=np.uint8),
    )
    for name in ["left", "right"]:
        yield f"/{name}/camera_info", "sensor_msgs/msg/CameraInfo", BEGIN, camera_info(m, BEGIN, 4, 2)
        yield f"/{name}/image_raw/compressed", "sensor_msgs/msg/CompressedImage", BEGIN, image
    for line in [
        "GPGGA,221320.000,4851.000000,N,00221.000000,E,4,12,0.9,60.0,M,44.5,M,,",
        "GPRMC,221320.000,A,4851.000000,N,00221.000000,E,3.0,90.0,141123,,,A",
    ]:
        text = f"${line}*{reduce(xor, line.encode()):02X}"
        sentence = m.make("nmea_msgs/msg/Sentence", header=m.header(BEGIN, "gnss"), sentence=text)
        yield "/nmea_sentence", "nmea_msgs/msg/Sentence", BEGIN, sentence


def clouds(one, topic="/points", kind="sensor_msgs/msg/PointCloud2"):
    return lambda m: ((topic, kind, BEGIN + (sweep + 1) * TURN, one(m, sweep)) for sweep in range(SWEEPS))


def write1(path, content, compression=None):
    m = Messages(Stores.ROS1_NOETIC)
    writer = Writer1(path)
    if compression:
        writer.set_compression(compression)
    with writer:
        connections = {}
        for topic, kind, nanos, message in content(m):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=m.types)
            writer.write(connections[topic], nanos, m.types.serialize_ros1(message, kind))


def write2(path, content, plugin, compressed=False, little=True, mode=CompressionMode.STORAGE):
    m = Messages(Stores.ROS2_HUMBLE)
    writer = Writer2(path, version=9, storage_plugin=plugin)
    if compressed:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, kind, nanos, message in content(m):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=m.types)
            writer.write(connections[topic], nanos, m.types.serialize_cdr(message, kind, little_endian=little))


def main(out):
    out.mkdir(parents=True, exist_ok=True)
    write1(out / "street.bag", street)
    write1(out / "street_bz2.bag", street, Writer1.CompressionFormat.BZ2)
    write1(out / "street_lz4.bag", street, Writer1.CompressionFormat.LZ4)
    write2(out / "street_sqlite", street, StoragePlugin.SQLITE3)
    write2(out / "street_mcap", street, StoragePlugin.MCAP)
    write2(out / "street_zstd", street, StoragePlugin.MCAP, compressed=True)
    write2(out / "street_file", street, StoragePlugin.SQLITE3, compressed=True, mode=CompressionMode.FILE)
    write2(out / "street_message", street, StoragePlugin.SQLITE3, compressed=True, mode=CompressionMode.MESSAGE)
    # The names are not in the order of time.
    (out / "street_split").mkdir(exist_ok=True)
    write1(out / "street_split" / "a.bag", split(True), Writer1.CompressionFormat.BZ2)
    write1(out / "street_split" / "b.bag", split(False), Writer1.CompressionFormat.BZ2)
    write1(out / "moving.bag", moving, Writer1.CompressionFormat.BZ2)
    write2(out / "ouster", clouds(ouster), StoragePlugin.MCAP, compressed=True)
    write2(out / "hesai", clouds(hesai), StoragePlugin.MCAP, compressed=True, little=False)
    write2(out / "livox_cloud", clouds(livox_cloud), StoragePlugin.MCAP, compressed=True)
    write2(out / "untimed", clouds(untimed), StoragePlugin.MCAP, compressed=True)
    livox = clouds(livox_custom, "/livox/lidar", "livox_ros_driver2/msg/CustomMsg")
    write2(out / "livox_custom", livox, StoragePlugin.MCAP, compressed=True)
    write1(out / "cameras.bag", cameras, Writer1.CompressionFormat.BZ2)
    write1(out / "two_lidars.bag", two_lidars, Writer1.CompressionFormat.BZ2)


main(Path(sys.argv[1]))
