#!/usr/bin/env python3
"""Reads the output of `replica-foxglove` with other programs.

  pip install mcap mcap-protobuf-support websockets pillow
  lab/peers/foxglove.py file RECORDING.mcap CONVERTED.mcap     # both files, message by message
  lab/peers/foxglove.py live ws://127.0.0.1:8765 SECONDS       # what a client receives

`file` decodes the converted file by the schemas that it carries and compares it by value with the recording, which it reads by its byte
tables. `live` subscribes to all channels of a server and counts.
"""
import asyncio
import io
import json
import struct
import sys
from collections import Counter

KINDS = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f", "u64": "Q", "i64": "q", "f64": "d"}


def fields(described, data):
    values = {}
    for field in described:
        found = struct.unpack_from(f"<{field['count']}{KINDS[field['kind']]}", data, field["offset"])
        values[field["name"]] = found[0] if field["count"] == 1 else list(found)
    return values


def recorded(path):
    """(topic, envelope, header, rows as a function of their number) of each message of a recording."""
    from mcap.reader import make_reader

    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            if channel.topic.endswith(".tick"):
                continue
            table = json.loads(schema.data)
            header_at, rows_at = 64, 64 + table["header_bytes"]
            row = lambda i, t=table, d=message.data, at=rows_at: fields(t["row"], d[at + i * t["row_bytes"] :])
            yield channel.topic, fields(table["envelope"], message.data), fields(table["header"], message.data[header_at:]), row


def point(cloud, i):
    kinds = {1: "B", 3: "H", 5: "I", 7: "f"}
    at = i * cloud.point_stride
    return {f.name: struct.unpack_from("<" + kinds[f.type], cloud.data, at + f.offset)[0] for f in cloud.fields}


def check_file(recording, converted):
    from mcap_protobuf.decoder import DecoderFactory
    from mcap.reader import make_reader
    from PIL import Image

    submaps, columns, sweeps, poses, images = {}, {}, {}, [], 0
    for topic, envelope, header, row in recorded(recording):
        if topic == "submap":
            submaps[envelope["stamp"]] = (envelope["seq"], envelope["len"], row)
        elif topic in ("color", "class", "instance"):
            columns[topic, envelope["seq"]] = row
        elif topic == "sweep":
            sweeps[envelope["stamp"]] = (envelope["len"], row)
        elif topic == "trajectory":
            poses += [(row(i)["stamp"], row(i)["odom_from_body.translation"]) for i in range(envelope["len"])]
        elif topic == "image":
            images += 1
    seen, faults = Counter(), 0
    body = []
    with open(converted, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            seen[channel.topic, schema.name] += 1
            if channel.topic == "/points":
                seq, n, row = submaps[message.log_time]
                n_shown = len(decoded.data) // decoded.point_stride
                step = -(-n // n_shown) if n_shown else 1
                for i in range(0, n_shown, max(1, n_shown // 50)):
                    shown, true = point(decoded, i), row(i * step)
                    faults += any(shown[name] != true[name] for name in ("x", "y", "z", "intensity"))
                    if ("class", seq) in columns:
                        of_class = columns["class", seq](i * step)
                        faults += (shown["class"], shown["score"]) != (of_class["class_id"], of_class["score"])
                    if ("color", seq) in columns:
                        color = columns["color", seq](i * step)
                        faults += color["camera"] != 255 and [shown[c] for c in ("red", "green", "blue")] != [color[c] for c in "rgb"]
            elif channel.topic == "/sweep":
                n, row = sweeps[message.log_time]
                faults += len(decoded.data) // decoded.point_stride != n
                for i in range(0, n, max(1, n // 20)):
                    shown, true = point(decoded, i), row(i)
                    faults += any(shown[name] != true[name] for name in shown)
            elif channel.topic == "/tf":
                body += [(t.timestamp.ToNanoseconds(), t.translation) for t in decoded.transforms if t.child_frame_id == "body"]
            elif channel.topic.startswith("/camera"):
                Image.open(io.BytesIO(decoded.data)).load()
    faults += len(body) != len(poses)
    for (stamp, there), (due, xyz) in zip(sorted(body, key=lambda b: b[0]), poses):
        faults += stamp != due or [there.x, there.y, there.z] != xyz
    n_images = sum(n for (topic, _), n in seen.items() if topic.startswith("/camera"))
    n_clouds = sum(n for (topic, _), n in seen.items() if topic == "/points")
    faults += (n_images, n_clouds) != (images, len(submaps))
    for (topic, schema), n in sorted(seen.items()):
        print(f"{topic:12s} {schema:28s} {n:6d}")
    print(f"differences: {faults}")
    return faults == 0


async def watch(url, seconds):
    import websockets

    channels, counts, sizes = {}, Counter(), Counter()
    async with websockets.connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:
        loop = asyncio.get_running_loop()
        end = loop.time() + seconds
        while loop.time() < end:
            try:
                message = await asyncio.wait_for(socket.recv(), max(0.01, end - loop.time()))
            except (asyncio.TimeoutError, websockets.ConnectionClosed):
                break
            if isinstance(message, str):
                content = json.loads(message)
                if content["op"] == "advertise":
                    new = [channel for channel in content["channels"] if channel["id"] not in channels]
                    channels |= {channel["id"]: channel for channel in new}
                    asked = [{"id": channel["id"], "channelId": channel["id"]} for channel in new]
                    await socket.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
            elif message[0] == 1:
                (subscription,) = struct.unpack_from("<I", message, 1)
                counts[subscription] += 1
                sizes[subscription] += len(message)
    for number, channel in sorted(channels.items(), key=lambda c: c[1]["topic"]):
        print(f"{channel['topic']:12s} {channel['schemaName']:28s} {counts[number]:6d} {sizes[number] / 1e6:9.1f} MB")
    return sum(counts.values()) > 0


if __name__ == "__main__":
    if len(sys.argv) != 4 or sys.argv[1] not in ("file", "live"):
        sys.exit(__doc__)
    command, first, second = sys.argv[1:]
    done = check_file(first, second) if command == "file" else asyncio.run(watch(first, float(second)))
    sys.exit(0 if done else 1)
