"""Publishes the messages of a rig with Cyclone DDS, as ROS 2 with this middleware does.

    python -m venv venv && venv/bin/pip install cyclonedds==11.0.1
    venv/bin/python cyclone_peer.py sensors --reliable      # one of each kind of message: what tests/suite/cyclone.rs expects
    venv/bin/python cyclone_peer.py cameras --count 6 --hz 10 --seconds 60 --bytes 500000     # load
    venv/bin/python cyclone_peer.py relay /tmp/sent         # what `replica send` writes and sends, as messages

`sensors` writes what it publishes as lines `<topic> <sha256 of the data>` to stdout.
"""

import argparse
import hashlib
import re
import socket
import struct
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int8, int32, sequence, uint8, uint16, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic
from cyclonedds.util import duration

BEGIN = 1_700_000_000_000_000_000
STEP = 100_000_000


def message(package, name):
    return dict(typename=f"{package}.msg.dds_.{name}_")


@dataclass
class Time(IdlStruct, **message("builtin_interfaces", "Time")):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, **message("std_msgs", "Header")):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct, **message("geometry_msgs", "Vector3")):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, **message("geometry_msgs", "Quaternion")):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Image(IdlStruct, **message("sensor_msgs", "Image")):
    header: Header
    height: uint32
    width: uint32
    encoding: str
    is_bigendian: uint8
    step: uint32
    data: sequence[uint8]


@dataclass
class CompressedImage(IdlStruct, **message("sensor_msgs", "CompressedImage")):
    header: Header
    format: str
    data: sequence[uint8]


@dataclass
class Imu(IdlStruct, **message("sensor_msgs", "Imu")):
    header: Header
    orientation: Quaternion
    orientation_covariance: array[float64, 9]
    angular_velocity: Vector3
    angular_velocity_covariance: array[float64, 9]
    linear_acceleration: Vector3
    linear_acceleration_covariance: array[float64, 9]


@dataclass
class NavSatStatus(IdlStruct, **message("sensor_msgs", "NavSatStatus")):
    status: int8
    service: uint16


@dataclass
class NavSatFix(IdlStruct, **message("sensor_msgs", "NavSatFix")):
    header: Header
    status: NavSatStatus
    latitude: float64
    longitude: float64
    altitude: float64
    position_covariance: array[float64, 9]
    position_covariance_type: uint8


@dataclass
class Sentence(IdlStruct, **message("nmea_msgs", "Sentence")):
    header: Header
    sentence: str


@dataclass
class VelodynePacket(IdlStruct, **message("velodyne_msgs", "VelodynePacket")):
    stamp: Time
    data: array[uint8, 1206]


@dataclass
class VelodyneScan(IdlStruct, **message("velodyne_msgs", "VelodyneScan")):
    header: Header
    packets: sequence[VelodynePacket]


@dataclass
class PacketMsg(IdlStruct, **message("ouster_sensor_msgs", "PacketMsg")):
    buf: sequence[uint8]


def at(nanos):
    return Time(nanos // 1_000_000_000, nanos % 1_000_000_000)


def header(nanos, frame="sensor"):
    return Header(at(nanos), frame)


def noise(seed, n):
    """Random bytes from a seed."""
    blocks = (hashlib.sha256(struct.pack("<II", seed, index)).digest() for index in range((n + 31) // 32))
    return b"".join(blocks)[:n]


class Prepared:
    """A message serialized by Cyclone DDS except its last sequence of bytes, which would pass through a Python list."""

    def __init__(self, sample, data):
        head = sample.serialize(use_version_2=False)
        # The empty sequence is the last value.
        self.bytes = head[: head.rindex(b"\0\0\0\0")] + struct.pack("<I", len(data)) + data

    def serialize(self, use_version_2):
        return self.bytes


def write(writer, sample):
    """A writer that also writes prepared samples."""
    kind = writer.data_type
    writer.data_type = type(sample)
    writer.write(sample)
    writer.data_type = kind


class Rig:
    def __init__(self, domain, reliable):
        self.participant = DomainParticipant(domain)
        reliability = Policy.Reliability.Reliable(duration(seconds=10)) if reliable else Policy.Reliability.BestEffort
        self.reliable = reliable
        # Reliable publishers of ROS keep some messages; this one must lose none.
        history = Policy.History.KeepAll if reliable else Policy.History.KeepLast(10)
        self.qos = Qos(reliability, history, Policy.DataRepresentation(use_cdrv0_representation=True))

    def writer(self, topic, kind):
        return DataWriter(self.participant, Topic(self.participant, f"rt{topic}", kind, qos=self.qos), qos=self.qos)

    def wait(self, writers):
        """Waits until all writers have a subscriber."""
        while not all(writer.get_matched_subscriptions() for writer in writers):
            time.sleep(0.05)
        # The subscriber must also have discovered the publisher before best-effort messages are sent.
        time.sleep(1)


def sensors(args):
    rig = Rig(args.domain, args.reliable)
    kinds = {
        "/front/image_raw/compressed": CompressedImage,
        "/left/image_raw": Image,
        "/hs02/image_raw": Image,
        "/imu/data": Imu,
        "/fix": NavSatFix,
        "/nmea_sentence": Sentence,
        "/velodyne_packets": VelodyneScan,
        "/ouster/lidar_packets": PacketMsg,
    }
    writers = {topic: rig.writer(topic, kind) for topic, kind in kinds.items() if topic not in args.without}
    rig.wait(writers.values())

    def publish(topic, sample, data):
        if topic in writers:
            write(writers[topic], sample)
            print(topic, hashlib.sha256(data).hexdigest(), flush=True)
            # A rig sends over time; with best effort an overload is not reported.
            time.sleep(args.pause)

    for index in range(args.n):
        stamp = BEGIN + index * STEP
        jpeg = b"\xff\xd8\xff\xe0" + noise(index, 480_001)
        image = Prepared(CompressedImage(header(stamp), "jpeg", []), jpeg)
        publish("/front/image_raw/compressed", image, jpeg)
        if args.damaged and index == 0:
            # Cyclone DDS writes no message that does not fit its type; a driver may write any content.
            writers["/front/image_raw/compressed"].write(CompressedImage(header(stamp + 1), "theora", [1, 2, 3]))
            writers["/left/image_raw"].write(Image(header(stamp + 1), 1312, 1280, "rgb8", 0, 3 * 1280, [1, 2, 3]))
        # 5 MB, serialized by Cyclone DDS as a whole.
        width, height = 1280, 1312
        pixels = noise(100 + index, 3 * width * height)
        image = Image(header(stamp), height, width, "rgb8", 0, 3 * width, list(pixels))
        publish("/left/image_raw", image, pixels)
        samples = noise(200 + index, 2 * 320 * 240)
        mosaic = Image(header(stamp), 240, 320, "mono16", 0, 640, list(samples))
        publish("/hs02/image_raw", mosaic, struct.pack(">76800H", *struct.unpack("<76800H", samples)))
        zeros = [0.0] * 9
        for sample in range(20):
            stamp_imu = stamp + sample * 5_000_000
            rate, acceleration = (0.25, -0.5, sample / 8), (0.125, 0.0, 9.75)
            imu = Imu(header(stamp_imu), Quaternion(0, 0, 0, 1), zeros, Vector3(*rate), zeros, Vector3(*acceleration), zeros)
            line = ",".join([str(stamp_imu)] + [f"{value:g}" for value in acceleration + rate])
            publish("/imu/data", imu, (line + "\n").encode())
        fix = NavSatFix(header(stamp), NavSatStatus(0, 1), 48.5, 2.25, 93.5, zeros, 0)
        publish("/fix", fix, b"")
        sentence = f"$GPGGA,22132{index}.00,4830.0,N,00215.0,E,1,08,1.0,93.5,M,0.0,M,,*00\r\n"
        publish("/nmea_sentence", Sentence(header(stamp), sentence), sentence.encode())
        packets = [noise(1000 * (index + 1) + packet, 1206) for packet in range(75)]
        scan = VelodyneScan(header(stamp), [VelodynePacket(at(stamp), list(packet)) for packet in packets])
        publish("/velodyne_packets", scan, b"".join(packets))
        packet = noise(300 + index, 24_896)
        publish("/ouster/lidar_packets", PacketMsg(list(packet)), packet)
    finish(rig, writers.values())


def finish(rig, writers):
    for writer in writers:
        if rig.reliable:
            writer.wait_for_acks(duration(seconds=30))
    # Best-effort datagrams are in transit.
    time.sleep(1)


def cameras(args):
    """Images at a rate. A late one is sent at once, as by a camera."""
    rig = Rig(args.domain, args.reliable)
    writers = [rig.writer(f"/camera{index}/image_raw/compressed", CompressedImage) for index in range(args.count)]
    rig.wait(writers)
    jpeg = b"\xff\xd8\xff\xe0" + noise(1, args.bytes - 4)
    begin, behind = time.time_ns(), 0.0
    n = int(args.seconds * args.hz)
    for index in range(n):
        due = begin + int(index * 1e9 / args.hz)
        time.sleep(max(0, due - time.time_ns()) / 1e9)
        behind = max(behind, (time.time_ns() - due) / 1e9)
        for writer in writers:
            write(writer, Prepared(CompressedImage(header(due), "jpeg", []), jpeg))
    finish(rig, writers)
    seconds = (time.time_ns() - begin) / 1e9
    print(f"{n} images of each of {args.count} cameras in {seconds:.1f} s, {time.process_time():.1f} s of processor, at most {behind:.3f} s late")


def relay(args):
    """Publishes as messages the data that `replica send` writes into a folder and sends to three ports."""
    rig = Rig(args.domain, args.reliable)
    ports = {"/imu/data": args.imu, "/nmea_sentence": args.nmea, "/velodyne_packets": args.lidar}
    sockets = {}
    for topic, port in ports.items():
        sockets[topic] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sockets[topic].setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        sockets[topic].bind(("127.0.0.1", port))
        sockets[topic].setblocking(False)
    colors = [rig.writer(f"/camera{index}/image_raw/compressed", CompressedImage) for index in range(args.cameras)]
    folders = {Path(args.folder) / "camera" / str(index): writer for index, writer in enumerate(colors)}
    mosaics = {Path(args.folder) / name: rig.writer(f"/{name}/image_raw", Image) for name in args.mosaics}
    imu, nmea = rig.writer("/imu/data", Imu), rig.writer("/nmea_sentence", Sentence)
    velodyne = rig.writer("/velodyne_packets", VelodyneScan)
    rig.wait([*folders.values(), *mosaics.values(), imu, nmea, velodyne])
    print("ready", flush=True)
    seen, n, last, scan, zeros = set(), dict.fromkeys(["images", "imu", "nmea", "packets"], 0), None, [], [0.0] * 9

    def datagrams(topic):
        while True:
            try:
                yield sockets[topic].recv(65536)
            except BlockingIOError:
                return

    while last is None or time.time() - last < args.quiet:
        for folder, writer in [*folders.items(), *mosaics.items()]:
            for path in sorted(folder.glob("[0-9]*.*")):
                if path in seen:
                    continue
                seen.add(path)
                data, stamp = path.read_bytes(), int(path.stem)
                if path.suffix == ".pgm":
                    found = re.match(rb"P5\s+(\d+)\s+(\d+)\s+(\d+)\s", data)
                    width, height, largest = (int(group) for group in found.groups())
                    wide, samples = largest > 255, data[found.end():]
                    size = 2 if wide else 1
                    image = Image(header(stamp), height, width, "mono16" if wide else "mono8", 1, size * width, [])
                    write(writer, Prepared(image, samples))
                else:
                    write(writer, Prepared(CompressedImage(header(stamp), path.suffix[1:], []), data))
                n["images"] += 1
        for line in b"".join(datagrams("/imu/data")).decode().splitlines():
            fields = line.split(",")
            if fields[0].isdigit():
                values = [float(field) for field in fields[1:7]]
                sample = Imu(header(int(fields[0])), Quaternion(0, 0, 0, 1), zeros, Vector3(*values[3:]), zeros, Vector3(*values[:3]), zeros)
                imu.write(sample)
                n["imu"] += 1
        for line in b"".join(datagrams("/nmea_sentence")).decode().splitlines():
            nmea.write(Sentence(header(time.time_ns()), line))
            n["nmea"] += 1
        for packet in datagrams("/velodyne_packets"):
            last = time.time()
            scan.append(VelodynePacket(at(time.time_ns()), list(packet)))
            n["packets"] += 1
            # A driver sends a revolution.
            if len(scan) == args.packets:
                velodyne.write(VelodyneScan(header(time.time_ns()), scan))
                scan = []
        time.sleep(0.002)
    finish(rig, [*folders.values(), *mosaics.values(), imu, nmea, velodyne])
    print(n, flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    for function in (sensors, cameras, relay):
        command = commands.add_parser(function.__name__)
        command.set_defaults(function=function)
        command.add_argument("--domain", type=int, default=0)
        command.add_argument("--reliable", action="store_true")
        if function is sensors:
            command.add_argument("--n", type=int, default=3)
            command.add_argument("--pause", type=float, default=0.005)
            command.add_argument("--damaged", action="store_true", help="also images without their pixels")
            command.add_argument("--without", action="append", default=[])
        elif function is cameras:
            command.add_argument("--count", type=int, default=6)
            command.add_argument("--hz", type=float, default=10)
            command.add_argument("--seconds", type=float, default=60)
            command.add_argument("--bytes", type=int, default=500_000)
        else:
            command.add_argument("folder")
            command.add_argument("--cameras", type=int, default=6)
            command.add_argument("--mosaics", nargs="*", default=["hs02", "hs03"])
            for option, port in (("--imu", 20120), ("--nmea", 20110), ("--lidar", 22368)):
                command.add_argument(option, type=int, default=port)
            command.add_argument("--packets", type=int, default=150)
            command.add_argument("--quiet", type=float, default=3)
    args = parser.parse_args()
    args.function(args)


if __name__ == "__main__":
    sys.exit(main())
