//! Recordings: messages read back equal, equal runs give equal bytes, truncation and changed bytes are detected, and files of
//! other programs are refused.

use messages::pod::bytes_from_rows;
use messages::{ByteTable, ClassHeader, ClassRow, ClassTopic, Envelope, SweepHeader, SweepPoint, SweepTopic, TickRow};
use recording::{RecordingError, RecordingReader, RecordingWriter, TickReader};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const N_TICKS: u64 = 5;

fn row(tick: u64) -> TickRow {
    let barrier = u64::from(tick == 2);
    let end = u32::from(tick + 1 == N_TICKS);
    TickRow { tick, n_published: tick + 1, barrier, drive_time: tick as i64 * 100, born_nanos: 77, progress: 0.5, end }
}

/// Records sweeps and a column for each sweep. `now` replaces the clock.
pub(super) fn record(path: &Path, now: u64, leave_out: Option<u64>) {
    let about = BTreeMap::from([("mode".to_owned(), "offline".to_owned())]);
    let tables = [ByteTable::of::<ClassTopic>(), ByteTable::of::<SweepTopic>()];
    let mut writer = RecordingWriter::create(path, &about, &tables).expect("creates");
    for tick in 0..N_TICKS {
        let n_points = 1000 * tick as usize;
        let envelope = Envelope {
            seq: tick,
            stamp: 1_700_000_000_000_000_000 + tick as i64,
            tick,
            born_nanos: now,
            sent_nanos: now + 1,
            len: n_points as u32,
            ..Envelope::default()
        };
        let points = vec![SweepPoint { x: tick as f32, ..SweepPoint::default() }; n_points];
        let classes = vec![ClassRow { class_id: tick as u8, score: 9 }; n_points];
        let sweep = [SweepHeader::default()];
        let class = [ClassHeader::default()];
        let parts = [
            ("class", bytes_from_rows(&class), bytes_from_rows(&classes)),
            ("sweep", bytes_from_rows(&sweep), bytes_from_rows(&points)),
        ];
        for (topic, header, rows) in parts {
            if leave_out != Some(tick) {
                writer.message(topic, row(tick).drive_time, &envelope, header, rows).expect("writes");
            }
            writer.tick(topic, &row(tick)).expect("writes");
        }
    }
    writer.finish().expect("finishes");
}

/// Sequence numbers of the sweeps that can be read, and the result at the end.
fn sweeps(path: &Path) -> (Vec<u64>, Result<(), RecordingError>) {
    let mut reader = match RecordingReader::open(path) {
        Ok(reader) => reader,
        Err(error) => return (Vec::new(), Err(error)),
    };
    let mut seqs = Vec::new();
    loop {
        match reader.next() {
            Ok(Some(message)) if message.topic.name == "sweep" => {
                let seq = message.envelope.seq;
                let rows = messages::pod::rows_from_bytes::<SweepPoint>(message.rows()).expect("whole rows");
                assert!(rows.len() == 1000 * seq as usize && rows.iter().all(|point| point.x == seq as f32));
                seqs.push(seq);
            }
            Ok(Some(_)) => {}
            Ok(None) => return (seqs, Ok(())),
            Err(error) => {
                assert!(reader.next().is_ok_and(|message| message.is_none()), "nothing comes after an error");
                return (seqs, Err(error));
            }
        }
    }
}

fn file(folder: &tempfile::TempDir, name: &str) -> PathBuf {
    folder.path().join(name)
}

#[test]
fn recorded_messages_read_back_tick_by_tick() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = file(&folder, "a.mcap");
    record(&path, 5, None);
    let mut ticks = TickReader::open(&path, &["sweep", "class"]).expect("opens");
    assert_eq!(ticks.recording().about().get("mode").map(String::as_str), Some("offline"));
    for tick in 0..N_TICKS {
        let got = ticks.next().expect("whole").expect("a tick");
        assert_eq!(got.row, TickRow { born_nanos: 0, ..row(tick) }, "all but the clock");
        for (messages, row_bytes) in got.messages.iter().zip([size_of::<SweepPoint>(), size_of::<ClassRow>()]) {
            assert_eq!((messages.len(), messages[0].envelope.seq), (1, tick));
            assert!(messages[0].bytes.len() >= 64 + 1000 * tick as usize * row_bytes);
        }
    }
    assert!(ticks.next().expect("whole").is_none() && ticks.ended());
    assert_eq!(sweeps(&path).0, [0, 1, 2, 3, 4]);
}

#[test]
fn recording_does_not_depend_on_the_clock() {
    let folder = tempfile::tempdir().expect("a folder");
    let one = file(&folder, "a.mcap");
    let other = file(&folder, "b.mcap");
    record(&one, 5, None);
    record(&other, 123_456, None);
    assert!(std::fs::read(one).expect("written") == std::fs::read(other).expect("written"));
}

#[test]
fn truncated_file_is_read_up_to_the_cut_and_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = file(&folder, "whole.mcap");
    let cut = file(&folder, "cut.mcap");
    // Two chunks: the first ends when it has a MiB.
    let about = BTreeMap::new();
    let mut writer = RecordingWriter::create(&whole, &about, &[ByteTable::of::<SweepTopic>()]).expect("creates");
    let header = [SweepHeader::default()];
    for seq in 0..3 {
        let rows = vec![SweepPoint { x: seq as f32, ..SweepPoint::default() }; 1000 * seq as usize];
        let envelope = Envelope { seq, tick: seq, len: rows.len() as u32, ..Envelope::default() };
        writer.message("sweep", 0, &envelope, bytes_from_rows(&header), bytes_from_rows(&rows)).expect("writes");
        writer.flush().expect("flushes");
    }
    writer.finish().expect("finishes");
    let bytes = std::fs::read(&whole).expect("written");
    let mut seen = std::collections::BTreeSet::new();
    for length in (8..bytes.len()).step_by(97).chain(bytes.len() - 40..bytes.len()) {
        std::fs::write(&cut, &bytes[..length]).expect("written");
        let (seqs, end) = sweeps(&cut);
        assert!(seqs.iter().copied().eq(0..seqs.len() as u64), "cut to {length}: {seqs:?}");
        seen.insert(seqs.len());
        match end {
            Err(RecordingError::Cut { offset, whole, .. }) => assert!(offset == length as u64 && whole <= offset),
            other => panic!("cut to {length} bytes: {other:?}"),
        }
    }
    assert_eq!(seen.into_iter().collect::<Vec<_>>(), [0, 1, 2, 3]);
}

#[test]
fn changed_byte_is_detected_anywhere() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = file(&folder, "whole.mcap");
    let changed = file(&folder, "changed.mcap");
    record(&whole, 5, None);
    let bytes = std::fs::read(&whole).expect("written");
    let mut unseen = Vec::new();
    for at in (0..bytes.len()).step_by(1009).chain(0..200).chain(bytes.len() - 200..bytes.len()) {
        let mut copy = bytes.clone();
        copy[at] ^= 0x10;
        std::fs::write(&changed, copy).expect("written");
        if sweeps(&changed).1.is_ok() {
            unseen.push(at);
        }
    }
    assert!(unseen.is_empty(), "changes at {unseen:?} were not detected");
}

/// Such a record was once read from past its chunk, and a build with overflow checks panicked.
#[test]
fn record_that_exceeds_its_chunk_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = file(&folder, "whole.mcap");
    let changed = file(&folder, "changed.mcap");
    record(&whole, 5, None);
    let mut bytes = std::fs::read(&whole).expect("written");
    let length_at = |bytes: &[u8], at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"));
    // After the magic follow records of opcode, length and body.
    let mut chunk = mcap::MAGIC.len();
    while bytes[chunk] != mcap::records::op::CHUNK {
        chunk += 9 + length_at(&bytes, chunk + 1) as usize;
    }
    // In the body of a chunk: 24 bytes, the checksum (0: none), the length of a name (0), the length of the records.
    let sum = chunk + 9 + 24;
    let length = chunk + 9 + 32;
    bytes[sum..sum + 4].fill(0);
    let shorter = length_at(&bytes, length) - 1;
    bytes[length..length + 8].copy_from_slice(&shorter.to_le_bytes());
    std::fs::write(&changed, bytes).expect("written");
    let error = sweeps(&changed).1.expect_err("refused").to_string();
    assert!(error.contains("changed.mcap: byte ") && error.contains("bytes left has a record of kind 5"), "{error}");
}

#[test]
fn recording_with_missing_message_is_refused_as_input() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = file(&folder, "gap.mcap");
    for (left_out, words) in [(0, "follows 0 messages, 1 were published"), (3, "follows 3 messages, 4 were")] {
        record(&path, 5, Some(left_out));
        let mut ticks = TickReader::open(&path, &["sweep"]).expect("opens");
        let error = loop {
            match ticks.next() {
                Ok(tick) => assert!(tick.is_some(), "the gap was not detected"),
                Err(error) => break error.to_string(),
            }
        };
        assert!(error.contains(words), "{error}");
        assert!(error.contains("gap.mcap: byte "), "{error}");
    }
    let error = TickReader::open(&path, &["submap"]).err().expect("refused").to_string();
    assert!(error.ends_with("gap.mcap: no topic submap with its ticks; the recording has class, sweep"), "{error}");
}

#[test]
fn tick_reader_without_topics_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = file(&folder, "a.mcap");
    record(&path, 5, None);
    let error = TickReader::open(&path, &[]).err().expect("refused").to_string();
    assert!(error.ends_with("a.mcap: no topic was requested; the recording has class, sweep"), "{error}");
}

#[test]
fn files_of_other_programs_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = file(&folder, "letter.mcap");
    let refused = |path: &Path| RecordingReader::open(path).err().expect("refused").to_string();
    for content in [&b""[..], b"Dear", b"Dear reader, this is a letter"] {
        std::fs::write(&path, content).expect("written");
        assert!(refused(&path).ends_with("letter.mcap: not an MCAP file"), "{}", refused(&path));
    }
    let mut others = mcap::Writer::new(std::fs::File::create(&path).expect("created")).expect("creates");
    let schema = others.add_schema("sensor_msgs/msg/Imu", "ros2msg", b"float64 x").expect("adds");
    others.add_channel(schema, "/imu", "cdr", &BTreeMap::new()).expect("adds");
    others.finish().expect("finishes");
    assert!(refused(&path).contains("no channel has the encoding replica-bytes"), "{}", refused(&path));
    assert!(refused(&file(&folder, "absent.mcap")).contains("absent.mcap: No such file"));
}
