//! Launch files, manifests, recordings, models, saved states and requests.

use crate::with_file;
use formats::drive::{SourcePosition, read_manifest};
use formats::recording::{RecordingReader, TickReader};
use run::control::{Answer, MAX_REQUEST, Request};
use run::launch_file::LaunchFile;
use run::state_file::{load_state, verify_state};
use segmentation::Options;
use stage::decode_state;
use std::path::Path;

pub(crate) fn launch_file(bytes: &[u8]) {
    match LaunchFile::parse(Path::new("launch.toml"), String::from_utf8_lossy(bytes).into_owned(), &[]) {
        Ok(file) => {
            for (name, _) in file.tables() {
                if let Err(problem) = file.table(&name) {
                    let _ = file.render(&file.located(&name, problem));
                }
            }
        }
        Err(problems) => assert!(!problems.is_empty()),
    }
}

pub(crate) fn drive_manifest(bytes: &[u8]) {
    with_file(".toml", bytes, |path| match read_manifest(path) {
        Ok(manifest) => assert!(manifest.rig().is_ok()),
        Err(error) => assert!(!error.problems.is_empty() && !error.to_string().is_empty()),
    });
}

pub(crate) fn mcap(bytes: &[u8]) {
    with_file(".mcap", bytes, |path| {
        if let Ok(mut reader) = RecordingReader::open(path) {
            while let Ok(Some(message)) = reader.next() {
                let _ = (message.header(), message.rows(), message.tick_row());
            }
        }
        if let Ok(mut reader) = TickReader::open(path, &["class"]) {
            let mut n_ticks = 0;
            while let Ok(Some(_)) = reader.next() {
                n_ticks += 1;
                assert!(n_ticks <= bytes.len(), "{n_ticks} ticks");
            }
        }
    });
}

pub(crate) fn model(bytes: &[u8]) {
    with_file(".safetensors", bytes, |path| {
        let _ = segmentation::load(path, &Options::default());
    });
}

/// A state file, and its content as it is behind the checksum.
pub(crate) fn state(bytes: &[u8]) {
    with_file(".state", bytes, |path| {
        assert_eq!(load_state(path).is_ok(), verify_state(path).is_ok(), "both read the same file");
    });
    let _ = decode_state::<SourcePosition>(2, bytes);
    let _ = decode_state::<run::state_file::RunnerState>(2, bytes);
    let _ = decode_state::<stage::Bytes>(2, bytes);
}

/// A request as the supervisor decodes it, and an answer as its client does.
pub(crate) fn control(bytes: &[u8]) {
    if bytes.len() <= MAX_REQUEST {
        let _ = serde_json::from_slice::<Request>(bytes);
        let _ = serde_json::from_slice::<Answer>(bytes);
    }
}
