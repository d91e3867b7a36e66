//! Comparison of recordings.

use crate::support::{printed, replica, succeeded, text};
use formats::recording::RecordingWriter;
use messages::pod::bytes_from_rows;
use messages::{ByteTable, Envelope, ImuRow, ImuTopic, NoHeader, TickRow};
use std::collections::BTreeMap;
use std::path::Path;

const N_TICKS: u64 = 40;

/// A recording of 40 ticks. `ends`: the last one is the last of its run.
fn record(path: &Path, ends: bool) {
    let mut writer = RecordingWriter::create(path, &BTreeMap::new(), &[ByteTable::of::<ImuTopic>()]).expect("creates");
    // Large enough for several chunks.
    let rows = vec![ImuRow::default(); 1000];
    let header = [NoHeader::default()];
    for tick in 0..N_TICKS {
        let envelope = Envelope { seq: tick, tick, len: rows.len() as u32, ..Envelope::default() };
        writer.message("imu", 0, &envelope, bytes_from_rows(&header), bytes_from_rows(&rows)).expect("writes");
        let end = u32::from(ends && tick + 1 == N_TICKS);
        writer.tick("imu", &TickRow { tick, n_published: tick + 1, end, ..TickRow::default() }).expect("writes");
    }
    writer.finish().expect("finishes");
}

fn compared(a: &Path, b: &Path) -> (Option<i32>, String) {
    let output = replica(&["compare", text(a), text(b)]);
    (output.status.code(), printed(&output))
}

#[test]
fn complete_recording_equals_itself() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole.mcap");
    record(&whole, true);
    assert!(succeeded(&replica(&["compare", text(&whole), text(&whole)])).ends_with("\nequal\n"));
}

#[test]
fn cut_recording_compared_with_itself_is_not_complete() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, cut) = (folder.path().join("whole.mcap"), folder.path().join("cut.mcap"));
    record(&whole, true);
    let bytes = std::fs::read(&whole).expect("reads");
    for n_bytes in [60, bytes.len() / 4, bytes.len() / 2, bytes.len() - 20] {
        std::fs::write(&cut, &bytes[..n_bytes]).expect("writes");
        let (code, said) = compared(&cut, &cut);
        assert_eq!(code, Some(3), "{n_bytes} bytes: {said}");
        for words in
            ["a is not complete: ", "b is not complete: ", "cut at byte", "equal as far as both go, but not complete"]
        {
            assert!(said.contains(words), "{n_bytes} bytes: {words:?} is not in\n{said}");
        }
    }
    // A complete recording that goes further is different.
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).expect("writes");
    let (code, said) = compared(&whole, &cut);
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("b is not complete") && !said.contains("a is not complete"), "{said}");
    assert!(said.ends_with("different\n") && said.contains("messages only in a"), "{said}");
}

#[test]
fn recording_without_the_end_of_its_run_compared_with_itself_is_not_complete() {
    let folder = tempfile::tempdir().expect("a folder");
    let stopped = folder.path().join("stopped.mcap");
    record(&stopped, false);
    let (code, said) = compared(&stopped, &stopped);
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("a is not complete: imu.tick does not reach the end of the run"), "{said}");
    assert!(said.ends_with("equal as far as both go, but not complete\n"), "{said}");
}
