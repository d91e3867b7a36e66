#!/usr/bin/env python3
"""A recording read by the reference reader of MCAP: header, statistics, channels, metadata; every message is read with
its checksum checked, and rows are read by the byte table that the file carries.

  pip install mcap
  lab/peers/mcap_list.py RECORDING.mcap
"""
import json
import struct
import sys

from mcap.reader import make_reader

KINDS = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f", "u64": "Q", "i64": "q", "f64": "d"}


def fields(described: list[dict], data: bytes) -> dict:
    """Values of a struct's fields; of an array the list."""
    values = {}
    for field in described:
        found = struct.unpack_from(f"<{field['count']}{KINDS[field['kind']]}", data, field["offset"])
        values[field["name"]] = found[0] if field["count"] == 1 else list(found)
    return values


def main() -> None:
    with open(sys.argv[1], "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        header, summary = reader.get_header(), reader.get_summary()
        print(f"library: {header.library}, profile: {header.profile!r}")
        statistics = summary.statistics
        print(f"{statistics.message_count} messages, {statistics.chunk_count} chunks, "
              f"{statistics.message_start_time} to {statistics.message_end_time} ns")
        for metadata in reader.iter_metadata():
            print(f"metadata {metadata.name}: {sorted(metadata.metadata)}")
        first, n_rows = {}, {}
        for schema, channel, message in reader.iter_messages():
            table = json.loads(schema.data)
            envelope = fields(table["envelope"], message.data[:64])
            rows_at = 64 + table["header_bytes"]
            assert len(message.data) == rows_at + envelope["len"] * table["row_bytes"], channel.topic
            n_rows[channel.topic] = n_rows.get(channel.topic, 0) + envelope["len"]
            if envelope["len"] and channel.topic not in first:
                first[channel.topic] = fields(table["row"], message.data[rows_at:])
        for id, channel in sorted(summary.channels.items()):
            schema = summary.schemas[channel.schema_id]
            count = statistics.channel_message_counts.get(id, 0)
            print(f"{channel.topic}: {schema.name} ({schema.encoding}), {count} messages, {n_rows.get(channel.topic, 0)} rows")
            if channel.topic in first:
                print(f"  first row: {first[channel.topic]}")


main()
