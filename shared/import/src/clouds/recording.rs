//! Writes tiles as submaps of a recording: one tick per submap.

use super::scanner::N_RINGS;
use super::sweeps::Sweeps;
use super::tile_files::TilePoint;
use crate::error::{At, ImportError};
use messages::pod::bytes_from_rows;
use messages::{
    ByteTable, CLASS_TABLE_VERSION, ClassHeader, ClassRow, ClassTopic, ColorHeader, ColorRow, ColorTopic, Envelope,
    InstanceHeader, InstanceTopic, Message, NoHeader, PoseRow, StampedPose, SubmapHeader, SubmapPoint, SubmapTopic,
    TickRow, TrajectoryTopic,
};
use recording::RecordingWriter;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Camera of colored points: the clouds do not say which one saw them.
const CAMERA: u8 = 0;
/// Pause between two files of a data set, ns.
const PAUSE_NANOS: i64 = 1_000_000_000;

/// What all clouds have besides positions and classes.
pub(super) struct Given {
    pub instances: bool,
    pub colors: bool,
}

/// A recording of submaps with their truth and their colors.
pub(super) struct SubmapRecording {
    path: PathBuf,
    writer: RecordingWriter,
    /// Messages so far, by topic.
    n_messages: BTreeMap<&'static str, u64>,
    n_ticks: u64,
    n_submaps: u64,
    /// Sweeps of finished files.
    n_sweeps: u64,
    /// Tile of the last submap, if more parts of it follow.
    last_tile: Option<usize>,
    /// End of the written data, ns.
    end: i64,
    /// Written share of the clouds.
    progress: f32,
}

impl SubmapRecording {
    pub fn create(path: &Path, about: &BTreeMap<String, String>, given: &Given) -> Result<Self, ImportError> {
        let mut tables =
            vec![ByteTable::of::<SubmapTopic>(), ByteTable::of::<TrajectoryTopic>(), ByteTable::of::<ClassTopic>()];
        let mut topics = vec![SubmapTopic::TOPIC, TrajectoryTopic::TOPIC, ClassTopic::TOPIC];
        if given.instances {
            tables.push(ByteTable::of::<InstanceTopic>());
            topics.push(InstanceTopic::TOPIC);
        }
        if given.colors {
            tables.push(ByteTable::of::<ColorTopic>());
            topics.push(ColorTopic::TOPIC);
        }
        Ok(Self {
            path: path.to_owned(),
            writer: RecordingWriter::create(path, about, &tables).at(path)?,
            n_messages: topics.into_iter().map(|topic| (topic, 0)).collect(),
            n_ticks: 0,
            n_submaps: 0,
            n_sweeps: 0,
            last_tile: None,
            end: -PAUSE_NANOS,
            progress: 0.0,
        })
    }

    /// Earliest stamp of the next file, ns.
    pub fn next_stamp(&self) -> i64 {
        self.end.saturating_add(PAUSE_NANOS)
    }

    /// Adds points of a tile as a submap. Points are sorted by sweep.
    pub fn add(&mut self, sweeps: &Sweeps, tile: usize, points: &[TilePoint]) -> Result<(), ImportError> {
        let of_tile = sweeps.tiles[tile].clone();
        let is_new = self.last_tile != Some(tile);
        let header = self.header(sweeps, tile, points);
        let rows: Vec<SubmapPoint> = points.iter().map(|found| found.point).collect();
        let seq = self.n_submaps;
        self.message::<SubmapTopic>(seq, header.stamp_begin, header.stamp_end, &header, &rows)?;
        drop(rows);
        let classes: Vec<ClassRow> =
            points.iter().map(|found| ClassRow { class_id: found.class, score: u8::MAX }).collect();
        let class_header = ClassHeader { class_table_version: CLASS_TABLE_VERSION, model_digest: 0 };
        self.message::<ClassTopic>(seq, header.stamp_begin, header.stamp_end, &class_header, &classes)?;
        if self.n_messages.contains_key(InstanceTopic::TOPIC) {
            let instances: Vec<u32> = points.iter().map(|found| found.instance).collect();
            let ids: BTreeSet<u32> = instances.iter().copied().filter(|id| *id != 0).collect();
            let n_points = instances.iter().filter(|id| **id != 0).count() as u32;
            let header_of_ids = InstanceHeader { n_instances: ids.len() as u32, n_points, ..InstanceHeader::default() };
            self.message::<InstanceTopic>(seq, header.stamp_begin, header.stamp_end, &header_of_ids, &instances)?;
        }
        if self.n_messages.contains_key(ColorTopic::TOPIC) {
            let row = |found: &TilePoint| {
                let [r, g, b] = found.color;
                ColorRow { r, g, b, camera: CAMERA }
            };
            let colors: Vec<ColorRow> = points.iter().map(row).collect();
            let header_of_colors = ColorHeader { n_seen: colors.len() as u64 };
            self.message::<ColorTopic>(seq, header.stamp_begin, header.stamp_end, &header_of_colors, &colors)?;
        }
        if is_new {
            let poses: Vec<StampedPose> = of_tile.flat_map(|sweep| poses_of(sweeps, sweep)).collect();
            let number = self.n_messages[TrajectoryTopic::TOPIC];
            let begin = header.stamp_begin;
            self.message::<TrajectoryTopic>(number, begin, header.stamp_end, &NoHeader::default(), &poses)?;
        }
        self.last_tile = Some(tile);
        self.n_submaps += 1;
        self.end = self.end.max(header.stamp_end);
        self.tick(header.stamp_end, false)
    }

    /// Sets the written share of the clouds.
    pub fn set_progress(&mut self, share: f64) {
        self.progress = share as f32;
    }

    /// Ends a file. Sweep numbers continue in the next file.
    pub fn end_file(&mut self, n_sweeps: usize) {
        self.n_sweeps += n_sweeps as u64;
        self.last_tile = None;
    }

    /// Ends the recording. Returns the number of submaps.
    pub fn finish(mut self) -> Result<u64, ImportError> {
        let end = self.end.max(0);
        self.tick(end, true)?;
        self.writer.finish().at(&self.path)?;
        Ok(self.n_submaps)
    }

    fn header(&self, sweeps: &Sweeps, tile: usize, points: &[TilePoint]) -> SubmapHeader {
        let of_tile = sweeps.tiles[tile].clone();
        let origin = sweeps.origin_of(tile);
        let last = sweeps.all[of_tile.end - 1];
        let mut header = SubmapHeader {
            stamp_begin: sweeps.all[of_tile.start].stamp,
            stamp_end: last.stamp.saturating_add(i64::from(last.duration_nanos)),
            odom_from_submap: PoseRow { translation: origin, rotation: [0.0, 0.0, 0.0, 1.0] },
            min: [f32::INFINITY; 3],
            max: [f32::NEG_INFINITY; 3],
            n_sweeps: of_tile.len() as u32,
            n_rings: u32::from(N_RINGS),
            ..SubmapHeader::default()
        };
        for (entry, sweep) in header.sweeps.iter_mut().zip(of_tile) {
            *entry = sweeps.all[sweep].entry(self.n_sweeps + sweep as u64, origin);
        }
        for found in points {
            let SubmapPoint { x, y, z, sweep_idx, .. } = found.point;
            header.sweeps[usize::from(sweep_idx)].n_points += 1;
            for (k, value) in [x, y, z].into_iter().enumerate() {
                (header.min[k], header.max[k]) = (header.min[k].min(value), header.max[k].max(value));
            }
        }
        let mut first_point = 0;
        for entry in &mut header.sweeps[..header.n_sweeps as usize] {
            entry.first_point = first_point;
            first_point += entry.n_points;
        }
        header
    }

    fn message<T: Message>(
        &mut self,
        seq: u64,
        stamp: i64,
        drive_time: i64,
        header: &T::Header,
        rows: &[T::Row],
    ) -> Result<(), ImportError> {
        let len = rows.len() as u32;
        let envelope = Envelope { seq, stamp, tick: self.n_ticks, len, ..Envelope::default() };
        let header = bytes_from_rows(std::slice::from_ref(header));
        let written = self.writer.message(T::TOPIC, drive_time, &envelope, header, bytes_from_rows(rows));
        *self.n_messages.entry(T::TOPIC).or_default() += 1;
        written.at(&self.path)
    }

    fn tick(&mut self, drive_time: i64, is_end: bool) -> Result<(), ImportError> {
        for (topic, n_published) in &self.n_messages {
            let row = TickRow {
                tick: self.n_ticks,
                n_published: *n_published,
                drive_time,
                progress: if is_end { 1.0 } else { self.progress },
                end: u32::from(is_end),
                ..TickRow::default()
            };
            self.writer.tick(topic, &row).at(&self.path)?;
        }
        self.n_ticks += 1;
        Ok(())
    }
}

/// Poses at the first and at the last shot of a sweep. The axes of the scanner are the axes of the cloud.
fn poses_of(sweeps: &Sweeps, sweep: usize) -> [StampedPose; 2] {
    let sweep = sweeps.all[sweep];
    let pose = |stamp: i64, translation: [f64; 3]| StampedPose {
        stamp,
        odom_from_body: PoseRow { translation, rotation: [0.0, 0.0, 0.0, 1.0] },
    };
    [pose(sweep.stamp, sweep.begin), pose(sweep.stamp.saturating_add(i64::from(sweep.duration_nanos)), sweep.end)]
}
