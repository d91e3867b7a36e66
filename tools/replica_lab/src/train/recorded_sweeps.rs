//! Labeled submaps of recordings: labeled clouds that `replica import` has written, recorded runs over drives with labels, and recorded
//! runs whose predicted classes serve as truth.

use super::camera_columns::CameraNeeds;
use super::recipe_data::RecordingSource;
use super::submap_join::{LabeledSubmap, SubmapJoin};
use crate::recorded_classes::{has_topic, has_true_classes, rows};
use crate::true_points::TruePoints;
use anyhow::{Context, ensure};
use drive::{Drive, Shot};
use messages::{
    ClassId, ClassRow, ClassTopic, ColorTopic, Message, SpectraHeader, SpectraTopic, SubmapHeader, SubmapPoint,
    SubmapSweep, SubmapTopic,
};
use recording::{Recorded, RecordingReader};
use std::path::{Path, PathBuf};

/// Source of the classes.
enum Truth {
    /// Classes in the recording, after each submap.
    Recorded,
    /// Labels of the returns of a drive.
    Drive(Box<TruePoints>),
    /// Classes in the recording, after each submap, predicted by a model; only classes with at least this score are used.
    Predicted { least_score: u8 },
}

/// Reads a recording submap by submap. Memory: the submaps that wait for columns, and the labels of a submap.
pub struct RecordedSweeps {
    path: PathBuf,
    reader: RecordingReader,
    truth: Truth,
    join: SubmapJoin,
}

impl RecordedSweeps {
    /// Opens the recording of a source; paths are relative to `folder`. An error if it has no truth or lacks a topic.
    pub fn open(source: &RecordingSource, folder: &Path, needs: &CameraNeeds) -> anyhow::Result<Self> {
        let path = folder.join(&source.file);
        let reader = RecordingReader::open(&path)?;
        ensure!(has_topic(&reader, SubmapTopic::TOPIC), "{}: has no topic `{}`", path.display(), SubmapTopic::TOPIC);
        for (topic, feature) in [(ColorTopic::TOPIC, needs.color.as_deref()), (SpectraTopic::TOPIC, needs.spectra())] {
            let Some(feature) = feature.filter(|_| !has_topic(&reader, topic)) else { continue };
            anyhow::bail!(
                "{}: has no topic `{topic}`, and the feature {feature} of the recipe needs it: record the run with \
                 `--topics submap,{topic}`, or remove the feature",
                path.display()
            );
        }
        let truth = if let Some(drive) = &source.drive {
            Truth::Drive(Box::new(TruePoints::open(Drive::open(&folder.join(drive))?)?))
        } else if let Some(score) = source.predicted_above {
            let topic = ClassTopic::TOPIC;
            ensure!(
                has_topic(&reader, topic),
                "{}: has no topic `{topic}`, which predicted_above needs: record the run with `--topics submap,{topic}`",
                path.display()
            );
            Truth::Predicted { least_score: (255.0 * score).round() as u8 }
        } else {
            ensure!(
                has_true_classes(&reader),
                "{}: its classes are not the truth: `drive` must name the drive of this run, which has the labels; only \
                     labeled clouds that `replica import` has written need no drive; with `predicted_above`, predicted classes \
                     serve as truth",
                path.display()
            );
            Truth::Recorded
        };
        Ok(Self { path, reader, truth, join: SubmapJoin::new(needs.clone()) })
    }

    /// The next submap; `None` at the end.
    pub fn next(&mut self) -> anyhow::Result<Option<LabeledSubmap>> {
        let path = self.path.display().to_string();
        self.read_next().context(path)
    }

    fn read_next(&mut self) -> anyhow::Result<Option<LabeledSubmap>> {
        loop {
            if let Some(submap) = self.join.next(false)? {
                return Ok(Some(submap));
            }
            let Some(message) = self.reader.next()? else { return self.join.next(true) };
            add(&mut self.join, &mut self.truth, message)?;
        }
    }
}

/// Adds a message to its submap.
fn add(join: &mut SubmapJoin, truth: &mut Truth, message: Recorded<'_>) -> anyhow::Result<()> {
    let seq = message.envelope.seq;
    let topic = message.topic.name.as_str();
    let needs_color = join.needs().color.is_some();
    let needs_spectra = join.needs().spectra().is_some();
    if topic == SubmapTopic::TOPIC {
        let header: Vec<SubmapHeader> = rows(message.header())?;
        let header = header[0];
        let points = rows(message.rows())?;
        header.checked(seq).and_then(|checked| checked.check_points(&points))?;
        let classes = match truth {
            Truth::Drive(labels) => Some(classes_of_drive(labels, &header, &points)?),
            Truth::Recorded | Truth::Predicted { .. } => None,
        };
        if let Some(parts) = join.parts(seq) {
            parts.submap = Some((header, points));
            parts.classes = classes.or(parts.classes.take());
        }
    } else if topic == ClassTopic::TOPIC && !matches!(truth, Truth::Drive(_)) {
        let classes: Vec<ClassRow> = rows(message.rows())?;
        let least_score = if let Truth::Predicted { least_score } = truth { *least_score } else { 0 };
        let class =
            |row: &ClassRow| if row.score >= least_score { known(row.class_id) } else { ClassId::Unlabeled as u8 };
        if let Some(parts) = join.parts(seq) {
            parts.classes = Some(classes.iter().map(class).collect());
        }
    } else if topic == ColorTopic::TOPIC && needs_color {
        let colors = rows(message.rows())?;
        if let Some(parts) = join.parts(seq) {
            parts.camera.colors = Some(colors);
        }
    } else if topic == SpectraTopic::TOPIC && needs_spectra {
        let header: Vec<SpectraHeader> = rows(message.header())?;
        let header = Box::new(header[0]);
        let spectra = rows(message.rows())?;
        let missing = join.needs().without_band(&header).filter(|_| header.n_bands > 0);
        ensure!(
            missing.is_none(),
            "its spectra have no band near the one of the feature {} of the recipe",
            missing.unwrap_or_default()
        );
        if let Some(parts) = join.parts(seq) {
            parts.camera.spectra = Some((header, spectra));
        }
    }
    Ok(())
}

/// The classes of the returns of a drive; points without a label are unlabeled.
fn classes_of_drive(labels: &mut TruePoints, header: &SubmapHeader, points: &[SubmapPoint]) -> anyhow::Result<Vec<u8>> {
    let sweep = |point: &SubmapPoint| &header.sweeps[usize::from(point.sweep_idx)];
    let shots: Vec<Shot> = points.iter().map(|point| shot(point, sweep(point))).collect();
    let lidar = |i: usize| sweep(&points[i]).lidar as u8;
    let labels = labels.labels_of_shots(&shots, lidar)?;
    Ok(labels.iter().map(|label| label.map_or(ClassId::Unlabeled as u8, |label| known(label.class))).collect())
}

fn shot(point: &SubmapPoint, sweep: &SubmapSweep) -> Shot {
    let share = point.offset_nanos as f32 / sweep.duration_nanos.max(1) as f32;
    let begin = &sweep.submap_from_lidar_begin;
    let end = &sweep.submap_from_lidar_end;
    let lidar = [0, 1, 2].map(|axis| begin[axis] + share * (end[axis] - begin[axis]));
    let square: f32 = [point.x, point.y, point.z].iter().zip(lidar).map(|(p, lidar)| (p - lidar) * (p - lidar)).sum();
    Shot {
        stamp: sweep.stamp.saturating_add(i64::from(point.offset_nanos)),
        ring: point.ring,
        azimuth: Some(point.azimuth),
        range_m: Some(square.sqrt()),
    }
}

/// Classes that are not in the class table are unlabeled.
fn known(class: u8) -> u8 {
    ClassId::from_id(class).unwrap_or(ClassId::Unlabeled) as u8
}
