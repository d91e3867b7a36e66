#!/usr/bin/env python3
"""Writes a recording again with the reference writer of MCAP: each channel is declared before its first message, chunks are
compressed. `replica replay` gives the same result on both files.

  pip install mcap
  lab/peers/mcap_rewrite.py RECORDING.mcap REWRITTEN.mcap [zstd|lz4|none] [--reverse]

--reverse writes the messages from the last to the first one, which a replay refuses.
"""
import sys

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer


def main() -> None:
    source, target, *options = sys.argv[1:]
    compression = CompressionType[next((word for word in options if not word.startswith("--")), "zstd").upper()]
    with open(source, "rb") as file, open(target, "wb") as out:
        reader = make_reader(file, validate_crcs=True)
        writer = Writer(out, chunk_size=1 << 16, compression=compression)
        writer.start(profile="", library="mcap_rewrite.py")
        schemas, channels = {}, {}
        messages = reader.iter_messages()
        for schema, channel, message in reversed(list(messages)) if "--reverse" in options else messages:
            if channel.topic not in channels:
                if schema.name not in schemas:
                    schemas[schema.name] = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.name], channel.metadata)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time,
                               message.sequence)
        writer.finish()


main()
