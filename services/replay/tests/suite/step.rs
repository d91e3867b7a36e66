//! A recording is published as it was recorded, including after a restart.

use messages::pod::bytes_from_rows;
use messages::{ByteTable, ClassHeader, ClassRow, ClassTopic, Envelope, GnssRow, GnssTopic, NoHeader, TickRow};
use recording::RecordingWriter;
use replay::{Replay, Settings};
use stage::testing::{Bench, context};
use stage::{Context, Flow, Stage, StepError};
use std::collections::BTreeMap;
use std::path::Path;

const N_TICKS: u64 = 6;

fn record(path: &Path, ends: bool) {
    let mut writer = RecordingWriter::create(path, &BTreeMap::new(), &[ByteTable::of::<GnssTopic>()]).expect("creates");
    let header = [NoHeader::default()];
    for tick in 0..N_TICKS {
        let rows = vec![GnssRow { stamp: tick as i64, ..GnssRow::default() }; tick as usize];
        let envelope = Envelope { seq: tick, tick, stamp: 7 + tick as i64, len: tick as u32, ..Envelope::default() };
        writer.message("gnss", 0, &envelope, bytes_from_rows(&header), bytes_from_rows(&rows)).expect("writes");
        let end = u32::from(ends && tick + 1 == N_TICKS);
        let progress = (tick + 1) as f32 / 8.0;
        let row = TickRow { tick, n_published: tick + 1, end, progress, ..TickRow::default() };
        writer.tick("gnss", &row).expect("writes");
    }
    writer.finish().expect("finishes");
}

#[test]
fn replayed_messages_equal_recorded_ones_across_restart() {
    let folder = tempfile::tempdir().expect("a folder");
    record(&folder.path().join("a.mcap"), true);
    let settings = Settings { recording: "a.mcap".to_owned(), ..Settings::default() };
    let context = context(folder.path());
    let mut bench = Bench::<Replay>::new(&settings, &context).expect("opens");
    for tick in 0..N_TICKS {
        if tick == 3 {
            bench = bench.restarted(&settings, &context).expect("restarts");
        }
        let flow = bench.tick().expect("a tick");
        assert_eq!(flow == Flow::End, tick + 1 == N_TICKS);
        let messages = bench.take::<GnssTopic>();
        assert_eq!((messages.len(), messages[0].stamp()), (1, 7 + tick as i64));
        assert!(messages[0].rows().len() as u64 == tick && messages[0].rows().iter().all(|r| r.stamp == tick as i64));
    }
    assert_eq!((bench.counter("recordings_not_complete"), bench.doubt("recording_incomplete")), (0, None));
    assert_eq!(bench.doubt("topics_not_replayed"), None);
}

#[test]
fn truncated_recording_is_replayed_to_its_end_and_doubted() {
    let folder = tempfile::tempdir().expect("a folder");
    record(&folder.path().join("a.mcap"), false);
    let settings = Settings { recording: "a.mcap".to_owned(), ..Settings::default() };
    let mut bench = Bench::<Replay>::new(&settings, &context(folder.path())).expect("opens");
    let mut n_ticks = 1;
    while bench.tick().expect("a tick") == Flow::Continue {
        n_ticks += 1;
    }
    assert_eq!((n_ticks, bench.counter("recordings_not_complete")), (N_TICKS, 1));
    assert_eq!(bench.doubt("recording_incomplete"), Some(0.75), "six of eight ticks");
}

#[test]
fn replay_without_topics_that_stages_read_is_doubted() {
    let folder = tempfile::tempdir().expect("a folder");
    record(&folder.path().join("a.mcap"), true);
    let settings = Settings { recording: "a.mcap".to_owned(), ..Settings::default() };
    let context = Context { missing: vec!["placement".to_owned(), "spectra".to_owned()], ..context(folder.path()) };
    let mut bench = Bench::<Replay>::new(&settings, &context).expect("opens");
    bench.tick().expect("a tick");
    assert_eq!(bench.doubt("topics_not_replayed"), Some(2.0));
}

/// A recording of one topic of classes with this name.
fn record_classes(path: &Path, name: &str) {
    let table = ByteTable { topic: name.to_owned(), ..ByteTable::of::<ClassTopic>() };
    let mut writer = RecordingWriter::create(path, &BTreeMap::new(), &[table]).expect("creates");
    let header = [ClassHeader::default()];
    let rows = [ClassRow { class_id: 7, score: 9 }];
    let envelope = Envelope { len: 1, ..Envelope::default() };
    writer.message(name, 0, &envelope, bytes_from_rows(&header), bytes_from_rows(&rows)).expect("writes");
    writer.tick(name, &TickRow { n_published: 1, end: 1, ..TickRow::default() }).expect("writes");
    writer.finish().expect("finishes");
}

#[test]
fn topic_that_a_launch_file_has_named_is_replayed_under_its_name() {
    let folder = tempfile::tempdir().expect("a folder");
    record_classes(&folder.path().join("a.mcap"), "class_b");
    let settings = Settings { recording: "a.mcap".to_owned(), ..Settings::default() };
    let mut bench = Bench::<Replay>::new(&settings, &context(folder.path())).expect("opens");
    assert_eq!(bench.tick().expect("a tick"), Flow::End);
    let messages = bench.take_named::<ClassTopic>("class_b");
    assert_eq!(messages[0].rows(), [ClassRow { class_id: 7, score: 9 }]);
}

/// The recording of a program that writes messages in another order; a restart would not help.
#[test]
fn recording_in_another_order_than_that_of_ticks_ends_the_run_with_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mcap");
    let mut writer =
        RecordingWriter::create(&path, &BTreeMap::new(), &[ByteTable::of::<GnssTopic>()]).expect("creates");
    for tick in [1, 0] {
        writer.tick("gnss", &TickRow { tick, ..TickRow::default() }).expect("writes");
    }
    writer.finish().expect("finishes");
    let settings = Settings { recording: "a.mcap".to_owned(), ..Settings::default() };
    let mut bench = Bench::<Replay>::new(&settings, &context(folder.path())).expect("opens");
    let error = bench.tick().expect_err("refused");
    assert!(matches!(error, StepError::Configuration(_)), "{error}");
    assert!(error.to_string().contains("gnss begins with tick 1; a recording must begin with its run"), "{error}");
}

#[test]
fn recording_without_the_ticks_of_a_topic_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.mcap");
    // The recording of a program that has left the tick channel out.
    let mut file = mcap::Writer::new(std::fs::File::create(&path).expect("created")).expect("creates");
    let table = serde_json::to_vec(&ByteTable::of::<GnssTopic>()).expect("JSON");
    let schema = file.add_schema("replica.gnss.v1", "replica-bytes", &table).expect("adds");
    file.add_channel(schema, "gnss", "replica-bytes", &BTreeMap::new()).expect("adds");
    file.finish().expect("finishes");
    let settings = Settings { recording: "a.mcap".to_owned(), ..Settings::default() };
    let error = Replay::outputs_with(&settings, folder.path()).expect_err("refused").to_string();
    assert!(error.contains("topic gnss cannot be replayed: its ticks, channel gnss.tick, are not declared"), "{error}");
}

#[test]
fn outputs_are_the_topics_of_the_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    record(&folder.path().join("a.mcap"), true);
    let settings = Settings { recording: "a.mcap".to_owned(), ..Settings::default() };
    let ports = Replay::outputs_with(&settings, folder.path()).expect("opens");
    assert_eq!(ports.iter().map(stage::Port::topic).collect::<Vec<_>>(), ["gnss"]);
    std::fs::write(folder.path().join("a.mcap"), "a letter").expect("written");
    let error = Replay::outputs_with(&settings, folder.path()).expect_err("refused").to_string();
    assert!(error.ends_with("a.mcap: not an MCAP file"), "{error}");
}
