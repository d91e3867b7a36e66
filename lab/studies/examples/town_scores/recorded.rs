//! Submaps and predicted classes of a recorded run, with the true label of each point: poses, deskewing and moving points come
//! from the pipeline.

use crate::town::TownSubmap;
use drive::{Drive, Shot, TrueLabel, TrueLabels};
use messages::{ClassId, ClassRow, ClassTopic, SubmapTopic};
use recording::{RecordedMessage, TickReader};
use stage::Received;
use std::path::Path;

const NO_LABEL: TrueLabel = TrueLabel { class: ClassId::Unlabeled as u8, instance: 0 };

/// The submaps of a recording with the topics submap and class, and their predicted classes.
pub fn submaps(drive: &Path, recording: &Path) -> (Vec<TownSubmap>, Vec<Vec<ClassRow>>) {
    let labels = Drive::open(drive).expect("opens").true_labels().expect("has labels");
    let topics = [<SubmapTopic as messages::Message>::TOPIC, <ClassTopic as messages::Message>::TOPIC];
    let mut ticks = TickReader::open(recording, &topics).expect("opens");
    let mut submaps = Vec::new();
    let mut classes = Vec::new();
    while let Some(tick) = ticks.next().expect("reads") {
        submaps.extend(tick.messages[0].iter().map(|message| submap(message, &labels)));
        let rows = |message: &RecordedMessage| {
            Received::<ClassTopic>::from_bytes(&message.bytes).expect("is a class column").rows().to_vec()
        };
        classes.extend(tick.messages[1].iter().map(rows));
    }
    (submaps, classes)
}

fn submap(message: &RecordedMessage, labels: &TrueLabels) -> TownSubmap {
    let message = Received::<SubmapTopic>::from_bytes(&message.bytes).expect("is a submap");
    let header = *message.header();
    let points = message.rows().to_vec();
    let label = |point: &messages::SubmapPoint| {
        let stamp = header.sweeps[usize::from(point.sweep_idx)].stamp + i64::from(point.offset_nanos);
        let shot = Shot { stamp, ring: point.ring, azimuth: Some(point.azimuth), range_m: None };
        labels.find(&shot).unwrap_or(NO_LABEL)
    };
    let truth = points.iter().map(label).collect();
    TownSubmap { header: Box::new(header), points, truth }
}
