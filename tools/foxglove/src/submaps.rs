//! Submaps that wait for their columns.

use crate::clouds::ShownPoint;
use messages::pod::rows_from_bytes;
use messages::{
    ClassRow, ClassTopic, ColorRow, ColorTopic, InstanceTopic, Message, POINT_DYNAMIC, Pod, SubmapPoint, UNSEEN,
};
use std::collections::{BTreeMap, BTreeSet};

/// Largest number of waiting submaps. A column that is still missing then was missed.
const MOST_WAITING: usize = 6;
/// Color of a point that no camera saw.
const GRAY: [u8; 4] = [150, 150, 150, 255];

/// A submap with the known attributes of its points.
pub struct ShownSubmap {
    /// Stamp of the first shot, ns since 1970.
    pub stamp: i64,
    /// Pose of the submap.
    pub odom_from_submap: geometry::Pose,
    /// The points that are shown.
    pub points: Vec<ShownPoint>,
    /// One row in `step` is shown.
    step: usize,
    columns: BTreeSet<String>,
}

impl ShownSubmap {
    fn add_column(&mut self, topic: &str, rows: &[u8]) {
        self.columns.insert(topic.to_owned());
        let points = &mut self.points;
        let step = self.step;
        match topic {
            ColorTopic::TOPIC => {
                for (point, row) in points.iter_mut().zip(every::<ColorRow>(rows, step)) {
                    if row.camera != UNSEEN {
                        point.color = [row.r, row.g, row.b, 255];
                    }
                }
            }
            ClassTopic::TOPIC => {
                for (point, row) in points.iter_mut().zip(every::<ClassRow>(rows, step)) {
                    point.class = row.class_id;
                    point.score = row.score;
                }
            }
            _ => points.iter_mut().zip(every::<u32>(rows, step)).for_each(|(point, id)| point.instance = id),
        }
    }
}

/// Submaps by their numbers.
#[derive(Default)]
pub struct Submaps {
    expected: BTreeSet<String>,
    waiting: BTreeMap<u64, ShownSubmap>,
    /// Columns that arrived before their submap: topics are received independently of each other.
    early: BTreeMap<u64, BTreeMap<String, Vec<u8>>>,
    most_points: usize,
}

impl Submaps {
    /// The columns that are joined.
    pub const COLUMNS: [&'static str; 3] = [ColorTopic::TOPIC, ClassTopic::TOPIC, InstanceTopic::TOPIC];

    /// A collection that keeps up to `most_points` points of a submap.
    pub fn new(most_points: usize) -> Self {
        Self { most_points, ..Self::default() }
    }
    /// Waits for the columns among `topics`.
    pub fn expect<'a>(&mut self, topics: impl Iterator<Item = &'a str>) {
        self.expected = topics.filter(|topic| Self::COLUMNS.contains(topic)).map(str::to_owned).collect();
    }
    /// Adds a submap.
    pub fn add(&mut self, seq: u64, stamp: i64, odom_from_submap: geometry::Pose, rows: &[u8]) {
        // Odd: rows alternate between the beams, so an even step would leave out whole beams.
        let step = (rows.len() / size_of::<SubmapPoint>()).div_ceil(self.most_points) | 1;
        let shown = |point: &SubmapPoint| ShownPoint {
            position: [point.x, point.y, point.z],
            color: GRAY,
            intensity: point.intensity,
            moving: point.flags & POINT_DYNAMIC != 0,
            ..ShownPoint::default()
        };
        let points = every(rows, step).iter().map(shown).collect();
        let mut submap = ShownSubmap { stamp, odom_from_submap, points, step, columns: BTreeSet::new() };
        for (topic, rows) in self.early.remove(&seq).into_iter().flatten() {
            submap.add_column(&topic, &rows);
        }
        self.waiting.insert(seq, submap);
    }
    /// Adds a column of a submap.
    pub fn add_column(&mut self, topic: &str, seq: u64, rows: &[u8]) {
        if let Some(submap) = self.waiting.get_mut(&seq) {
            return submap.add_column(topic, rows);
        }
        self.early.entry(seq).or_default().insert(topic.to_owned(), rows.to_vec());
        // The submaps of the oldest columns were missed, or are already shown.
        while self.early.len() > MOST_WAITING {
            self.early.pop_first();
        }
    }
    /// Takes the oldest submap if it has all columns, or if too many wait, or in any case if `is_end`.
    pub fn take(&mut self, is_end: bool) -> Option<ShownSubmap> {
        let oldest = self.waiting.first_entry()?;
        let is_complete = self.expected.is_subset(&oldest.get().columns);
        if !(is_complete || is_end) && self.waiting.len() <= MOST_WAITING {
            return None;
        }
        self.waiting.pop_first().map(|(_, submap)| submap)
    }
}

/// Every `step`-th row.
fn every<T: Pod>(rows: &[u8], step: usize) -> Vec<T> {
    let bytes: Vec<u8> = rows.chunks_exact(size_of::<T>()).step_by(step).flatten().copied().collect();
    rows_from_bytes(&bytes).unwrap_or_default()
}
