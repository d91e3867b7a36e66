//! A recording is published as it was recorded, also after a restart.

use formats::recording::RecordingWriter;
use messages::pod::bytes_from_rows;
use messages::{ByteTable, Envelope, GnssRow, GnssTopic, NoHeader, TickRow};
use replay::{Replay, Settings};
use stage::testing::{Bench, context};
use stage::{Context, Flow, Stage};
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
