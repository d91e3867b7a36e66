//! Labeled submaps of recordings: labeled clouds that `replica import` has written, and recorded runs over drives with labels.

use super::recipe::RecordingSource;
use crate::lab::recorded_classes::{has_topic, has_true_classes, rows};
use crate::lab::true_points::TruePoints;
use anyhow::{Context, ensure};
use formats::drive::{Drive, Shot};
use formats::recording::RecordingReader;
use messages::{ClassId, ClassRow, ClassTopic, Message, SubmapHeader, SubmapPoint, SubmapSweep, SubmapTopic};
use std::path::{Path, PathBuf};

/// A submap with the class id of each point.
pub struct LabeledSubmap {
    pub header: SubmapHeader,
    pub points: Vec<SubmapPoint>,
    pub classes: Vec<u8>,
}

/// Where the classes are.
enum Truth {
    /// In the recording, after each submap.
    Recorded,
    /// Beside the returns of a drive.
    Drive(Box<TruePoints>),
}

/// Reads a recording submap by submap. Memory: one submap, and the labels of its sweeps.
pub struct RecordedSweeps {
    path: PathBuf,
    reader: RecordingReader,
    truth: Truth,
    /// A submap whose classes have not been read yet.
    waiting: Option<(u64, SubmapHeader, Vec<SubmapPoint>)>,
}

impl RecordedSweeps {
    /// Opens the recording of a source; paths are relative to `folder`. An error if its truth is nowhere.
    pub fn open(source: &RecordingSource, folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join(&source.file);
        let reader = RecordingReader::open(&path)?;
        ensure!(has_topic(&reader, SubmapTopic::TOPIC), "{}: has no topic `{}`", path.display(), SubmapTopic::TOPIC);
        let truth = if let Some(drive) = &source.drive {
            Truth::Drive(Box::new(TruePoints::open(Drive::open(&folder.join(drive))?)?))
        } else {
            ensure!(
                has_true_classes(&reader),
                "{}: its classes are not the truth: `drive` must name the drive of this run, whose labels are; only \
                     labeled clouds that `replica import` has written need none",
                path.display()
            );
            Truth::Recorded
        };
        Ok(Self { path, reader, truth, waiting: None })
    }

    /// The next submap; `None` at the end.
    pub fn next(&mut self) -> anyhow::Result<Option<LabeledSubmap>> {
        while let Some(message) = self.reader.next()? {
            let (seq, path) = (message.envelope.seq, &self.path);
            if message.topic.name == SubmapTopic::TOPIC {
                let header: Vec<SubmapHeader> = rows(message.header()).with_context(|| path.display().to_string())?;
                let (header, points) = (header[0], rows(message.rows()).with_context(|| path.display().to_string())?);
                header
                    .checked(seq)
                    .and_then(|checked| checked.check_points(&points))
                    .with_context(|| path.display().to_string())?;
                match &mut self.truth {
                    Truth::Drive(labels) => {
                        let classes = classes_of_drive(labels, &header, &points)?;
                        return Ok(Some(LabeledSubmap { header, points, classes }));
                    }
                    Truth::Recorded => self.waiting = Some((seq, header, points)),
                }
            } else if message.topic.name == ClassTopic::TOPIC
                && let Some((_, header, points)) = self.waiting.take_if(|(submap, ..)| *submap == seq)
            {
                let classes: Vec<ClassRow> = rows(message.rows()).with_context(|| path.display().to_string())?;
                let (n_points, n_classes) = (points.len(), classes.len());
                ensure!(
                    n_points == n_classes,
                    "{}: submap {seq} has {n_points} points and {n_classes} classes",
                    path.display()
                );
                let classes = classes.iter().map(|row| known(row.class_id)).collect();
                return Ok(Some(LabeledSubmap { header, points, classes }));
            }
        }
        Ok(None)
    }
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
    let (begin, end) = (&sweep.submap_from_lidar_begin, &sweep.submap_from_lidar_end);
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
