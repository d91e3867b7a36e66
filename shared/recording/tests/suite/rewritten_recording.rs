//! Recordings rewritten by another program, as by the Python package `mcap`: compressed, in small chunks, with each
//! channel declared just before its first message.

use super::recording::record;
use mcap::records::op;
use recording::{RecordingReader, TickReader};
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use std::collections::BTreeSet;
use std::io::Write;
use std::path::Path;

const MESSAGES_OF_A_CHUNK: usize = 3;

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

fn record_of(kind: u8, body: &[u8]) -> Vec<u8> {
    [&[kind], &(body.len() as u64).to_le_bytes()[..], body].concat()
}

fn schema_and_channel(channel: &mcap::Channel<'_>) -> Vec<u8> {
    let schema = channel.schema.as_ref().expect("has a schema");
    let schema_id = channel.id + 1;
    let id = channel.id;
    let length = (schema.data.len() as u32).to_le_bytes();
    let texts = [text(&schema.name), text(&schema.encoding)].concat();
    let schema = [&schema_id.to_le_bytes()[..], &texts, &length, &schema.data].concat();
    let texts = [text(&channel.topic), text(&channel.message_encoding)].concat();
    let channel = [&id.to_le_bytes()[..], &schema_id.to_le_bytes(), &texts, &[0; 4]].concat();
    [record_of(op::SCHEMA, &schema), record_of(op::CHANNEL, &channel)].concat()
}

fn chunk(compression: &str, content: &[u8]) -> Vec<u8> {
    let compressed = match compression {
        "zstd" => compress_to_vec(content, CompressionLevel::Fastest),
        "lz4" => {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            encoder.write_all(content).expect("compresses");
            encoder.finish().expect("compresses")
        }
        _ => content.to_vec(),
    };
    let head = [&[0; 16], &(content.len() as u64).to_le_bytes()[..], &crc32fast::hash(content).to_le_bytes()].concat();
    let length = (compressed.len() as u64).to_le_bytes();
    record_of(op::CHUNK, &[&head[..], &text(compression), &length, &compressed].concat())
}

/// Rewrites the recording `from`. The first `n_early` channels are declared before all messages.
fn rewrite(from: &Path, to: &Path, compression: &str, has_summary: bool, n_early: usize) {
    let bytes = std::fs::read(from).expect("reads");
    let mut declared = BTreeSet::new();
    let mut summary = Vec::new();
    let mut chunks = Vec::new();
    let mut content = Vec::new();
    for message in mcap::MessageStream::new(&bytes).expect("a recording") {
        let channel = message.expect("a message").channel;
        if declared.len() < n_early && declared.insert(channel.id) {
            content.extend(schema_and_channel(&channel));
        }
    }
    for (i, message) in mcap::MessageStream::new(&bytes).expect("a recording").enumerate() {
        let message = message.expect("a message");
        if declared.insert(message.channel.id) {
            let records = schema_and_channel(&message.channel);
            content.extend_from_slice(&records);
            summary.extend_from_slice(&records);
        }
        let times = [message.log_time.to_le_bytes(), message.publish_time.to_le_bytes()].concat();
        let head = [&message.channel.id.to_le_bytes()[..], &message.sequence.to_le_bytes(), &times].concat();
        content.extend(record_of(op::MESSAGE, &[&head[..], &message.data].concat()));
        if i % MESSAGES_OF_A_CHUNK == MESSAGES_OF_A_CHUNK - 1 {
            chunks.extend(chunk(compression, &std::mem::take(&mut content)));
        }
    }
    chunks.extend(chunk(compression, &content));
    let header = record_of(op::HEADER, &[text(""), text("another program")].concat());
    let data = [mcap::MAGIC, &header, &chunks, &record_of(op::DATA_END, &[0; 4])].concat();
    let begin = if has_summary { data.len() as u64 } else { 0 };
    let footer = record_of(op::FOOTER, &[&begin.to_le_bytes()[..], &[0; 12]].concat());
    let summary = if has_summary { summary } else { Vec::new() };
    std::fs::write(to, [&data, &summary, &footer, mcap::MAGIC].concat()).expect("written");
}

/// Rows and messages of all ticks.
fn ticks(path: &Path) -> Vec<String> {
    let mut reader = TickReader::open(path, &["class", "sweep"]).expect("opens");
    let mut ticks = Vec::new();
    while let Some(tick) = reader.next().expect("a tick") {
        ticks.push(format!("{tick:?}"));
    }
    assert!(reader.ended(), "{}", path.display());
    ticks
}

#[test]
fn rewritten_recording_has_the_ticks_of_the_original() {
    let folder = tempfile::tempdir().expect("a folder");
    let original = folder.path().join("a.mcap");
    let rewritten = folder.path().join("b.mcap");
    record(&original, 5, None);
    let expected = ticks(&original);
    for compression in ["", "lz4", "zstd"] {
        rewrite(&original, &rewritten, compression, true, 0);
        let reader = RecordingReader::open(&rewritten).expect("opens");
        let topics: Vec<&str> = reader.topics().iter().map(|topic| topic.name.as_str()).collect();
        assert_eq!(topics, ["class", "class.tick", "sweep", "sweep.tick"], "{compression:?}");
        assert!(ticks(&rewritten) == expected, "{compression:?}");
    }
}

#[test]
fn topic_that_begins_late_and_is_in_no_summary_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let original = folder.path().join("a.mcap");
    let rewritten = folder.path().join("b.mcap");
    record(&original, 5, None);
    rewrite(&original, &rewritten, "", false, 0);
    let error = TickReader::open(&rewritten, &["class"]).err().expect("refused").to_string();
    assert!(error.contains("no topic class with its ticks"), "{error}");
    // The ticks of classes are declared before the first message, the ticks of sweeps are not.
    rewrite(&original, &rewritten, "", false, 2);
    let mut reader = TickReader::open(&rewritten, &["class"]).expect("opens");
    let error = std::iter::from_fn(|| reader.next().transpose()).find_map(Result::err).expect("refused").to_string();
    assert!(error.contains("topic sweep begins after other messages and the file has no summary"), "{error}");
}

#[test]
fn cut_recording_has_declared_its_topics_before() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mcap");
    record(&path, 5, None);
    let bytes = std::fs::read(&path).expect("reads");
    std::fs::write(&path, &bytes[..bytes.len() - 100]).expect("written");
    assert_eq!(RecordingReader::open(&path).expect("opens").topics().len(), 4);
}

#[test]
fn damaged_or_unknown_compression_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let original = folder.path().join("a.mcap");
    let rewritten = folder.path().join("b.mcap");
    record(&original, 5, None);
    for (compression, expected) in [("zstd", "chunk compressed with zstd"), ("lz4", "chunk compressed with lz4")] {
        rewrite(&original, &rewritten, compression, true, 0);
        let mut bytes = std::fs::read(&rewritten).expect("reads");
        let name = bytes.windows(compression.len()).position(|bytes| bytes == compression.as_bytes());
        // After the name and the length of the compressed records: their magic number.
        bytes[name.expect("there") + compression.len() + 8] ^= 0xff;
        std::fs::write(&rewritten, &bytes).expect("written");
        let error = RecordingReader::open(&rewritten).err().expect("refused").to_string();
        assert!(error.contains(expected), "{error}");
    }
    rewrite(&original, &rewritten, "snappy", true, 0);
    let error = RecordingReader::open(&rewritten).err().expect("refused").to_string();
    assert!(error.contains("\"snappy\"; must be none, lz4 or zstd"), "{error}");
}
