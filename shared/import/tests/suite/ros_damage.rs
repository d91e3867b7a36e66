//! Imports of damaged bags.

use super::ros::{STREETS, bag};
use super::support::{folder, import_from, write_file};
use std::path::{Path, PathBuf};

/// Places at which a file is cut, and at which a byte is changed.
const N_CUTS: usize = 40;
const N_FLIPS: usize = 120;

/// The file with the messages.
fn file_of(name: &str) -> PathBuf {
    let path = bag(name);
    if path.is_file() {
        return path;
    }
    let files = path.read_dir().expect("lists").map(|entry| entry.expect("lists").path());
    files.into_iter().find(|path| !path.ends_with("metadata.yaml")).expect("a file")
}

/// The error of an import, if there is one.
fn import(path: &Path, bytes: &[u8], folder: &tempfile::TempDir) -> Option<String> {
    write_file(path, bytes);
    let import = import_from(path, folder);
    let error = import.run().err().map(|error| error.to_string());
    assert_eq!(import.out.exists(), error.is_none());
    let _ = std::fs::remove_dir_all(&import.out);
    error
}

#[test]
fn cut_bags_are_refused_with_their_name() {
    for name in STREETS {
        let folder = folder();
        let path = folder.path().join("cut");
        let bytes = std::fs::read(file_of(name)).expect("reads");
        assert_eq!(import(&path, &bytes, &folder), None, "{name}");
        // The first bytes determine the type of the file.
        let cuts = (16..bytes.len()).step_by(bytes.len() / N_CUTS).chain([bytes.len() - 1]);
        for n in cuts {
            let error = import(&path, &bytes[..n], &folder).unwrap_or_else(|| panic!("{name}: {n} bytes are accepted"));
            assert!(error.starts_with(&path.display().to_string()), "{name}: {error}");
        }
    }
}

#[test]
fn flipped_bytes_end_in_an_error_or_a_drive() {
    for name in STREETS {
        let folder = folder();
        let path = folder.path().join("flipped");
        let good = std::fs::read(file_of(name)).expect("reads");
        let mut n_refused = 0;
        for index in 0..N_FLIPS {
            // Every part of the file, and its start, which contains most structures.
            let at = if index % 2 == 0 { index * good.len() / N_FLIPS } else { index * 16 };
            let mut bytes = good.clone();
            bytes[at] ^= if index % 4 < 2 { 0xff } else { 1 << (index % 8) };
            n_refused += usize::from(import(&path, &bytes, &folder).is_some());
        }
        // Most bytes of a database are unused.
        assert!(n_refused >= 3, "{name}: {n_refused} of {N_FLIPS} are refused");
    }
}

#[test]
fn lengths_beyond_the_file_are_refused() {
    let folder = folder();
    let path = folder.path().join("long");
    for (name, mark, field) in [
        // Content of the first chunk; length of the first record.
        ("street.bag", &b"size="[..], 0),
        ("street_mcap", b"\x89MCAP0\r\n", 1),
    ] {
        let mut bytes = std::fs::read(file_of(name)).expect("reads");
        let at = bytes.windows(mark.len()).position(|window| window == mark).expect("is there") + mark.len() + field;
        bytes[at..at + 4].fill(0xff);
        let error = import(&path, &bytes, &folder).expect("is refused");
        assert!(error.contains("byte "), "{name}: {error}");
    }
}

#[test]
fn unclosed_bags_name_the_command_that_mends_them() {
    let folder = folder();
    let path = folder.path().join("open");
    let mut bytes = std::fs::read(file_of("street.bag")).expect("reads");
    let mark = b"index_pos=";
    let at = bytes.windows(mark.len()).position(|window| window == mark).expect("is there") + mark.len();
    bytes[at..at + 8].fill(0);
    assert!(import(&path, &bytes, &folder).expect("is refused").ends_with("run `rosbag reindex`"));

    let bytes = std::fs::read(file_of("street_mcap")).expect("reads");
    assert!(import(&path, &bytes[..bytes.len() - 40], &folder).expect("is refused").ends_with("run `mcap recover`"));

    let bytes = std::fs::read(file_of("street_sqlite")).expect("reads");
    write_file(&folder.path().join("open-wal"), [0; 33]);
    let error = import(&path, &bytes, &folder).expect("is refused");
    assert!(error.contains("open-wal has rows that are not in the database"), "{error}");
}

#[test]
fn compressed_folders_are_refused_with_their_metadata() {
    let folder = folder();
    let source = folder.path().join("bag");
    let text = std::fs::read_to_string(bag("street_sqlite/metadata.yaml")).expect("reads");
    let text: String = text
        .lines()
        .map(|line| {
            if line.trim().starts_with("compression_mode") {
                "  compression_mode: FILE\n".into()
            } else {
                format!("{line}\n")
            }
        })
        .collect();
    write_file(&source.join("metadata.yaml"), text);
    let error = import_from(&source, &folder).run().expect_err("is refused").to_string();
    assert!(error.contains("metadata.yaml: compression_mode FILE"), "{error}");
}

/// A topic of two sensors: its last message has another frame of the same length. Without the check, all messages would
/// get the mounting of the first one.
#[test]
fn topic_with_messages_of_two_frames_is_refused() {
    let folder = folder();
    let path = folder.path().join("two_frames.bag");
    let good = std::fs::read(file_of("street.bag")).expect("reads");
    for (frame, other, role) in [
        ("velodyne", "velorear", "lidar=NAME"),
        ("imu_link", "imu_rear", "imu=none"),
        ("camera_optical", "camera_at_back", "camera=none"),
    ] {
        let with_length = [&(frame.len() as u32).to_le_bytes()[..], frame.as_bytes()].concat();
        let last = good.windows(with_length.len()).rposition(|window| window == with_length).expect("is there");
        let mut bytes = good.clone();
        bytes[last + 4..][..other.len()].copy_from_slice(other.as_bytes());
        let error = import(&path, &bytes, &folder).unwrap_or_else(|| panic!("{frame} and {other} are accepted"));
        let words = format!("header.frame_id is {other:?}, the messages before it are in {frame:?}");
        assert!(error.contains(&words) && error.ends_with(&format!("--topic {role}")), "{error}");
        assert!(error.contains("message ") && error.contains(" of /"), "{error}");
    }
}
