//! Comparison of recordings.

use crate::support::{printed, replica, succeeded, text};
use formats::ply::{Header, Kind, PlyWriter, Row};
use messages::pod::bytes_from_rows;
use messages::{ByteTable, Envelope, ImuRow, ImuTopic, NoHeader, TickRow};
use recording::RecordingWriter;
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
    let whole = folder.path().join("whole.mcap");
    let cut = folder.path().join("cut.mcap");
    record(&whole, true);
    let bytes = std::fs::read(&whole).expect("reads");
    for n_bytes in [60, bytes.len() / 4, bytes.len() / 2, bytes.len() - 20] {
        std::fs::write(&cut, &bytes[..n_bytes]).expect("writes");
        let (code, said) = compared(&cut, &cut);
        assert_eq!(code, Some(3), "{n_bytes} bytes: {said}");
        for words in [
            "a is not complete: ",
            "b is not complete: ",
            "cut at byte",
            "equal up to the end of the shorter one, but not complete",
        ] {
            assert!(said.contains(words), "{n_bytes} bytes: {words:?} is not in\n{said}");
        }
    }
    // A complete recording that continues further is different.
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
    assert!(said.ends_with("equal up to the end of the shorter one, but not complete\n"), "{said}");
}

/// A run with one cloud: points 0.1 s apart from `begin`, each with the classes of two segmenters.
fn run_with_classes(folder: &Path, begin: f64, classes: &[[u8; 2]]) {
    std::fs::create_dir_all(folder.join("clouds")).expect("made");
    let header = Header::new([
        ("timestamp", Kind::Double),
        ("semantic", Kind::UChar),
        ("class_b", Kind::UChar),
        ("class_b_score", Kind::Float),
    ]);
    let file = folder.join("clouds/submap_0000.ply");
    let mut writer = PlyWriter::create(&file, &header, classes.len()).expect("creates");
    let encode = |i: usize, row: &mut Row<'_>| {
        row.f64(begin + 0.1 * i as f64).u8(classes[i][0]).u8(classes[i][1]).f32(0.5);
    };
    writer.write_each(classes.len(), encode).expect("writes");
    writer.finish().expect("finishes");
}

#[test]
fn classes_of_a_run_and_of_two_runs_are_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    let a = folder.path().join("a");
    let b = folder.path().join("b");
    // Road, sidewalk, vegetation.
    run_with_classes(&a, 1.0, &[[7, 7], [7, 8], [7, 8], [9, 9], [8, 7]]);
    run_with_classes(&b, 1.0, &[[7, 7], [7, 8], [7, 8], [9, 9], [7, 7]]);
    let output = replica(&["compare", "--json", text(&a)]);
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(output.status.code(), Some(3));
    let pair = &answer["pairs"][0];
    assert_eq!((&pair["a"]["topic"], &pair["b"]["topic"]), (&"class".into(), &"class_b".into()));
    assert_eq!((&pair["n_points"], &pair["n_same"]), (&5.into(), &2.into()));
    let road = serde_json::json!({ "class": "road", "n_a": 3, "n_b": 2, "n_both": 1, "iou": 0.25 });
    assert_eq!(pair["classes"][0], road);
    let expected = serde_json::json!([
        { "a": "road", "b": "sidewalk", "n": 2 },
        { "a": "sidewalk", "b": "road", "n": 1 },
    ]);
    assert_eq!(pair["differences"], expected);
    let (code, said) = compared(&a, &b);
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("5 points, 4 of the same class (80.0 %)"), "{said}");
    assert!(said.contains("5 points, 5 of the same class (100.0 %)"), "{said}");
}

#[test]
fn runs_with_other_points_and_runs_without_a_second_column_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let a = folder.path().join("a");
    let b = folder.path().join("b");
    run_with_classes(&a, 1.0, &[[7, 7], [7, 8]]);
    for (begin, classes) in [(2.0, &[[7, 7], [7, 8]][..]), (1.0, &[[7, 7]])] {
        run_with_classes(&b, begin, classes);
        let (code, said) = compared(&a, &b);
        assert!(code == Some(1) && said.contains("have different points"), "{said}");
    }
    let output = replica(&["compare", text(&a), "--topics", "class"]);
    assert_eq!(output.status.code(), Some(2), "{}", printed(&output));
    assert!(printed(&output).contains("its clouds have class, class_b"), "{}", printed(&output));
}
