//! Launch files, manifests, recordings, models, saved states and requests.

use crate::accepted::accepted;
use crate::scratch::{with_file, with_files};
use drive::{SourcePosition, read_manifest};
use messages::columns::{COLUMNS, Column, ColumnVisitor, visit_columns};
use messages::{
    CubeTopic, GnssTopic, ImageTopic, ImuTopic, Message, MosaicTopic, PlacementTopic, SubmapTopic, SweepTopic,
    TickTopic, TrajectoryTopic,
};
use recording::{RecordingReader, TickReader};
use run::control::{Answer, MAX_REQUEST, Request};
use run::launch_file::LaunchFile;
use run::state_file::{load_state, verify_state};
use run::summary::Summary;
use run::wiring::Wiring;
use segmentation::Options;
use stage::{Received, decode_head, decode_state, next_message};
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
    with_file("drive.toml", bytes, |path| {
        let read = read_manifest(path);
        accepted(&read);
        match read {
            Ok(manifest) => assert!(manifest.rig().is_ok()),
            Err(error) => assert!(!error.problems.is_empty() && !error.to_string().is_empty()),
        }
    });
}

pub(crate) fn mcap(bytes: &[u8]) {
    with_file("a.mcap", bytes, |path| {
        let opened = RecordingReader::open(path);
        accepted(&opened);
        if let Ok(mut reader) = opened {
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
    with_file("a.safetensors", bytes, |path| {
        accepted(&segmentation::load(path, &Options::default()));
    });
}

/// A state file, and its content without the checksum.
pub(crate) fn state(bytes: &[u8]) {
    with_file("a.state", bytes, |path| {
        assert_eq!(load_state(path).is_ok(), verify_state(path).is_ok(), "both read the same file");
    });
    let _ = decode_state::<SourcePosition>(2, bytes);
    let _ = decode_state::<run::state_file::RunnerState>(2, bytes);
    let _ = decode_state::<stage::Bytes>(2, bytes);
}

/// A request, decoded as by the supervisor, and an answer, decoded as by its client.
pub(crate) fn control(bytes: &[u8]) {
    if bytes.len() <= MAX_REQUEST {
        let _ = serde_json::from_slice::<Request>(bytes);
        let _ = serde_json::from_slice::<Answer>(bytes);
    }
}

/// Texts between the processes of a run; requests of users are in [`control`].
pub(crate) fn run_texts(bytes: &[u8]) {
    let _ = serde_json::from_slice::<run::assignment::Assignment>(bytes);
    let _ = serde_json::from_slice::<run::assignment::Description>(bytes);
    let _ = serde_json::from_slice::<run::assignment::Command>(bytes);
    if let Ok(health) = serde_json::from_slice::<run::health::Health>(bytes) {
        let _ = health.activity.to_string();
    }
}

pub(crate) fn summary(bytes: &[u8]) {
    with_files(&[("summary.json", bytes)], |folder| {
        let loaded = Summary::load(folder);
        accepted(&loaded);
        if let Ok(summary) = loaded {
            assert!(summary.doubts().count() <= bytes.len());
            let _ = summary.processed();
        }
    });
}

pub(crate) fn wiring(bytes: &[u8]) {
    with_files(&[("run/wiring.json", bytes)], |folder| {
        let read = Wiring::read(folder);
        accepted(&read);
        let Ok(wiring) = read else { return };
        let n_topics = wiring.topics().filter(|(_, topic)| wiring.topic(&topic.channels.topic).is_ok()).count();
        assert!(n_topics == wiring.topics().count() && n_topics <= bytes.len());
    });
}

/// The state of a stage: a head, then messages.
pub(crate) fn state_head(bytes: &[u8]) {
    let decoded = decode_head::<SourcePosition>(2, bytes);
    accepted(&decoded);
    let Ok((_, mut messages)) = decoded else { return };
    while let Ok(message) = next_message::<GnssTopic>(&mut messages) {
        assert!(size_of_val(message.rows()) <= bytes.len());
    }
    let _ = next_message::<PlacementTopic>(&mut messages).is_ok();
    let _ = next_message::<TrajectoryTopic>(&mut messages).is_ok();
}

/// A saved message. The first byte selects the topic.
pub(crate) fn saved_message(bytes: &[u8]) {
    fn check<T: Message>(bytes: &[u8]) {
        let read = Received::<T>::from_bytes(bytes);
        accepted(&read);
        if let Ok(message) = read {
            assert!(size_of_val(message.rows()) <= bytes.len());
            assert_eq!(message.to_bytes().len(), bytes.len());
            let _ = (messages::check_header::<T>(message.header()), messages::check_rows::<T>(message.rows()));
        }
    }
    /// Checks a column of the table, selected by its number.
    struct NthColumn<'a>(usize, &'a [u8]);
    impl ColumnVisitor for NthColumn<'_> {
        fn visit<T: Message>(&mut self, _: &'static Column) {
            if self.0 == 0 {
                check::<T>(self.1);
            }
            self.0 = self.0.wrapping_sub(1);
        }
    }
    let Some((topic, bytes)) = bytes.split_first() else { return };
    let n_columns = COLUMNS.iter().filter(|column| column.has_own_topic()).count();
    // Saved inputs keep their topics: the first four columns stand between the others.
    match usize::from(*topic) % (10 + n_columns) {
        0 => check::<SweepTopic>(bytes),
        1 => check::<TickTopic>(bytes),
        2 => check::<TrajectoryTopic>(bytes),
        3 => check::<PlacementTopic>(bytes),
        4 => check::<SubmapTopic>(bytes),
        column @ 5..=8 => visit_columns(&mut NthColumn(column - 5, bytes)),
        9 => check::<CubeTopic>(bytes),
        10 => check::<GnssTopic>(bytes),
        11 => check::<ImuTopic>(bytes),
        12 => check::<ImageTopic>(bytes),
        13 => check::<MosaicTopic>(bytes),
        column => visit_columns(&mut NthColumn(column - 10, bytes)),
    }
}

/// Largest tensors of [`spherical_model`], bytes.
const MAX_TENSORS: u64 = 1 << 20;

/// The header of a model on range images; its tensors are zeros.
pub(crate) fn spherical_model(bytes: &[u8]) {
    // The container must end with its last tensor.
    let header: serde_json::Value = serde_json::from_slice(bytes).unwrap_or_default();
    let ends = header.as_object().into_iter().flatten().filter_map(|(_, tensor)| tensor["data_offsets"][1].as_u64());
    let n_bytes = ends.max().unwrap_or(0).min(MAX_TENSORS);
    let file = [&(bytes.len() as u64).to_le_bytes()[..], bytes, &vec![0; n_bytes as usize]].concat();
    with_file("a.safetensors", &file, |path| accepted(&segmentation::load(path, &Options::default())));
}
