//! The true labels of an imported recording: its submaps equal the submaps of the run, point by point.

use crate::recorded_classes::{has_topic, has_true_classes, rows};
use crate::true_points::Labelled;
use anyhow::{Context, bail, ensure};
use drive::NoLabel;
use formats::ply::Vertices;
use messages::{ClassRow, ClassTopic, InstanceTopic, Message, SubmapPoint, SubmapTopic};
use rayon::prelude::*;
use recording::RecordingReader;
use scores::PointLabel;
use std::path::{Path, PathBuf};

/// Start of the comment of a cloud that has the number of its submap.
const NUMBER: &str = "REPLICA submap ";

/// Reads a recording submap by submap. Memory: one submap with its labels.
pub struct RecordedTruth {
    path: PathBuf,
    reader: RecordingReader,
    has_instances: bool,
    /// Number of the submap that was read last.
    last: Option<u64>,
}

/// A submap with its truth.
#[derive(Default)]
struct RecordedSubmap {
    points: Option<Vec<SubmapPoint>>,
    classes: Option<Vec<ClassRow>>,
    instances: Option<Vec<u32>>,
}

impl RecordedTruth {
    /// Opens a recording. An error unless it was written by an import.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let reader = RecordingReader::open(path)?;
        ensure!(
            has_true_classes(&reader),
            "{}: must be a recording of labeled clouds, as `replica import` writes it",
            path.display()
        );
        let has_instances = has_topic(&reader, InstanceTopic::TOPIC);
        Ok(Self { path: path.to_owned(), reader, has_instances, last: None })
    }

    /// The label of each point of a cloud. An error if the cloud is not one of this recording.
    pub fn labels_of(&mut self, cloud: &Vertices) -> anyhow::Result<Vec<Labelled>> {
        let number = cloud.comments().iter().find_map(|comment| comment.strip_prefix(NUMBER)?.parse().ok());
        let seq: u64 = number.with_context(|| format!("no comment \"{NUMBER}N\" in the header of the cloud"))?;
        let submap = self.submap(seq)?;
        let points = submap.points.unwrap_or_default();
        let classes = submap.classes.unwrap_or_default();
        let instances = submap.instances.unwrap_or_else(|| vec![0; points.len()]);
        let lengths = [cloud.len(), points.len(), classes.len(), instances.len()];
        ensure!(
            lengths.iter().all(|n| *n == lengths[0]),
            "the cloud has {} points, submap {seq} of {} has {} points, {} classes and {} instances: the run belongs to another \
             recording",
            lengths[0],
            self.path.display(),
            lengths[1],
            lengths[2],
            lengths[3]
        );
        let hundredths = |name: &str| -> anyhow::Result<Vec<i32>> {
            Ok(cloud.f32s(name)?.into_iter().map(|degrees| (degrees * 100.0).round() as i32).collect())
        };
        let azimuths = hundredths("azimuth_deg")?;
        let elevations = hundredths("elevation_deg")?;
        let rings = cloud.u8s("ring")?;
        let label = |i: usize| {
            let point = &points[i];
            let angles = (i32::from(point.azimuth), i32::from(point.elevation), point.ring);
            if angles != (azimuths[i], elevations[i], rings[i]) {
                return Err(NoLabel::OtherReturn);
            }
            Ok(PointLabel { class: classes[i].class_id, instance: instances[i] })
        };
        Ok((0..points.len()).into_par_iter().map(label).collect())
    }

    /// Reads up to a submap and its columns, which follow it.
    fn submap(&mut self, seq: u64) -> anyhow::Result<RecordedSubmap> {
        // Clouds are in the order of their submaps. Only a cloud out of this order makes a restart necessary.
        if self.last.is_some_and(|last| seq <= last) {
            self.reader = RecordingReader::open(&self.path)?;
        }
        self.last = Some(seq);
        let mut submap = RecordedSubmap::default();
        while let Some(message) = self.reader.next()? {
            if message.envelope.seq != seq {
                continue;
            }
            match message.topic.name.as_str() {
                SubmapTopic::TOPIC => submap.points = Some(rows(message.rows())?),
                ClassTopic::TOPIC => submap.classes = Some(rows(message.rows())?),
                InstanceTopic::TOPIC => submap.instances = Some(rows(message.rows())?),
                _ => {}
            }
            let is_whole = submap.points.is_some() && submap.classes.is_some();
            if is_whole && (submap.instances.is_some() || !self.has_instances) {
                return Ok(submap);
            }
        }
        bail!("{}: has no submap {seq}: the run belongs to another recording", self.path.display())
    }
}
