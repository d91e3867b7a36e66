//! A generated street with known values.

use export::Export;
use messages::columns::{COLUMNS, Presence};
use messages::{
    ClassHeader, ClassRow, ClassTopic, ColorHeader, ColorRow, ColorTopic, Envelope, InstanceHeader, InstanceTopic,
    MaterialHeader, MaterialRow, MaterialTopic, Message, NO_SPECTRUM, NoHeader, PoseRow, RegionHeader, RegionTopic,
    SpectraHeader, SpectraTopic, StampedPose, SubmapHeader, SubmapPoint, SubmapSweep, SubmapTopic, TrajectoryTopic,
    pod::bytes_from_rows,
};
use random::Random;
use stage::testing::Bench;
use stage::{Context, Received};
use std::path::Path;

const SWEEP_NANOS: u32 = 100_000_000;
const START: i64 = 1_700_000_000_123_456_789;
const BANDS: usize = 3;
/// The instance that moves.
pub const MOVING_INSTANCE: u32 = 3000;

/// A context in which the topics are connected that the stages publish by default.
pub fn context(folder: &Path) -> Context {
    let mut context = stage::testing::context(folder);
    let is_by_setting = |topic: &str| {
        COLUMNS.iter().any(|column| column.topic == topic && matches!(column.presence, Presence::Setting(_)))
    };
    context.connected.retain(|topic| !is_by_setting(topic));
    context
}

/// Submaps of a drive that turns left by half a radian with each of them.
pub struct Street {
    seed: u64,
    n_points: usize,
    /// Sweeps of a submap.
    n_sweeps: u64,
    /// Northing of the submaps' frames, m.
    north_m: f64,
}

/// Random number `i` of stream `stream`.
fn random(seed: u64, stream: u64, i: usize) -> u64 {
    Random::new(seed << 48 ^ stream << 32 ^ i as u64).bits()
}

impl Street {
    pub fn new(seed: u64, n_points: usize) -> Self {
        Self { seed, n_points, n_sweeps: 4, north_m: 5.0 }
    }
    fn draw(&self, seq: u64, field: u64, i: usize) -> u64 {
        random(self.seed, seq * 16 + field, i)
    }
    fn unit(&self, seq: u64, field: u64, i: usize) -> f32 {
        (self.draw(seq, field, i) >> 40) as f32 / (1 << 24) as f32
    }

    fn yaw(seq: u64) -> f64 {
        0.5 * seq as f64
    }
    /// A point of the submap frame in odom, computed independently.
    pub fn in_odom(&self, seq: u64, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let (sin, cos) = Self::yaw(seq).sin_cos();
        [20.0 * seq as f64 + cos * x - sin * y, self.north_m + sin * x + cos * y, z - 0.25]
    }
    pub fn first_sweep(&self, seq: u64) -> u64 {
        seq * self.n_sweeps
    }
    pub fn sweep_stamp(&self, seq: u64, sweep_idx: u16) -> i64 {
        START + (self.first_sweep(seq) + u64::from(sweep_idx)) as i64 * i64::from(SWEEP_NANOS)
    }
    /// The LiDAR at the first and last shot of a sweep, submap frame.
    fn lidar_ends(sweep_idx: u64) -> [[f32; 3]; 2] {
        [0.0, 1.0].map(|end| [1.5 * (sweep_idx as f32 + end), 0.125 * end, 2.0])
    }
    /// The LiDAR in odom when it measured `point`, computed independently.
    pub fn lidar(&self, seq: u64, point: &SubmapPoint) -> [f64; 3] {
        let [begin, end] = Self::lidar_ends(u64::from(point.sweep_idx));
        let share = f64::from(point.offset_nanos) / f64::from(SWEEP_NANOS);
        let at = |k: usize| f64::from(begin[k]) * (1.0 - share) + f64::from(end[k]) * share;
        self.in_odom(seq, [at(0), at(1), at(2)])
    }

    pub fn points(&self, seq: u64) -> Vec<SubmapPoint> {
        let point = |i: usize| SubmapPoint {
            x: self.unit(seq, 0, i) * 60.0 - 30.0,
            y: self.unit(seq, 1, i) * 40.0 - 20.0,
            z: self.unit(seq, 2, i) * 10.0,
            offset_nanos: self.draw(seq, 3, i) as u32 % SWEEP_NANOS,
            azimuth: (self.draw(seq, 4, i) % 36_000) as u16,
            elevation: (self.draw(seq, 5, i) % 4000) as i16 - 3000,
            sweep_idx: (i as u64 * self.n_sweeps / self.n_points.max(1) as u64) as u16,
            intensity: self.draw(seq, 6, i) as u8,
            ring: (self.draw(seq, 7, i) % 32) as u8,
            incidence: self.draw(seq, 8, i) as u8 | (u8::MAX * u8::from(i.is_multiple_of(5))),
            flags: u8::from(i.is_multiple_of(9)),
            reserved: 0,
        };
        (0..self.n_points).map(point).collect()
    }
    pub fn header(&self, seq: u64) -> SubmapHeader {
        let (half_sin, half_cos) = (Self::yaw(seq) / 2.0).sin_cos();
        let mut header = SubmapHeader {
            stamp_begin: self.sweep_stamp(seq, 0),
            stamp_end: self.sweep_stamp(seq, self.n_sweeps as u16) - 1,
            odom_from_submap: PoseRow {
                translation: [20.0 * seq as f64, self.north_m, -0.25],
                rotation: [0.0, 0.0, half_sin, half_cos],
            },
            n_sweeps: self.n_sweeps as u32,
            n_rings: 32,
            ..SubmapHeader::default()
        };
        for (sweep_idx, sweep) in (0..self.n_sweeps).zip(&mut header.sweeps) {
            let pose = |p: [f32; 3]| [p[0], p[1], p[2], 0.0, 0.0, 0.0, 1.0];
            let [begin, end] = Self::lidar_ends(sweep_idx).map(pose);
            *sweep = SubmapSweep {
                stamp: self.sweep_stamp(seq, sweep_idx as u16),
                seq: self.first_sweep(seq) + sweep_idx,
                duration_nanos: SWEEP_NANOS,
                submap_from_lidar_begin: begin,
                submap_from_lidar_end: end,
                ..SubmapSweep::default()
            };
        }
        header
    }
    pub fn color(&self, seq: u64) -> Vec<ColorRow> {
        let row = |i: usize| match self.draw(seq, 9, i).to_le_bytes() {
            [0..64, ..] => ColorRow { r: 0, g: 0, b: 0, camera: 255 },
            [camera, r, g, b, ..] => ColorRow { r, g, b, camera: camera % 6 },
        };
        (0..self.n_points).map(row).collect()
    }
    pub fn class(&self, seq: u64) -> Vec<ClassRow> {
        let row = |i: usize| {
            let draw = self.draw(seq, 10, i);
            ClassRow { class_id: (draw % 23) as u8, score: (draw >> 8) as u8 }
        };
        (0..self.n_points).map(row).collect()
    }
    pub fn material(&self, seq: u64) -> Vec<MaterialRow> {
        let row = |i: usize| {
            let draw = self.draw(seq, 15, i);
            MaterialRow { material_id: (draw % 14) as u8, score: (draw >> 8) as u8 }
        };
        (0..self.n_points).map(row).collect()
    }
    pub fn regions(&self, seq: u64) -> Vec<u32> {
        (0..self.n_points).map(|i| self.draw(seq, 16, i) as u32 % 100).collect()
    }
    pub fn instance(&self, seq: u64) -> Vec<u32> {
        (0..self.n_points).map(|i| (self.draw(seq, 11, i) % 40).saturating_sub(20) as u32 * 1000).collect()
    }
    pub fn spectra_message(&self, seq: u64) -> (SpectraHeader, Vec<u32>) {
        let has_spectrum = |i: usize| self.draw(seq, 12, i).is_multiple_of(2);
        let seen: Vec<usize> = (0..self.n_points).filter(|i| has_spectrum(*i)).collect();
        let mut header = SpectraHeader {
            n_points: self.n_points as u32,
            n_spectra: seen.len() as u32,
            n_bands: BANDS as u32,
            ..SpectraHeader::default()
        };
        header.wavelengths_nm[..BANDS].copy_from_slice(&[500.2, 611.8, 612.3]);
        let mut words: Vec<u32> = vec![NO_SPECTRUM; self.n_points];
        // The table is in another order than the points.
        for (index, point) in seen.iter().rev().enumerate() {
            words[*point] = index as u32;
        }
        for point in seen.iter().rev() {
            words.extend([self.valid(seq, *point), 0]);
            words.extend((0..BANDS).map(|band| self.unit(seq, 13, *point * BANDS + band).to_bits()));
        }
        (header, words)
    }
    fn valid(&self, seq: u64, point: usize) -> u32 {
        self.draw(seq, 14, point) as u32 % 8
    }
    /// Number of points with a spectrum, and the value of a point's band in the file.
    pub fn spectra(&self, seq: u64) -> (usize, impl Fn(usize, usize) -> f32) {
        let n_spectra = self.spectra_message(seq).0.n_spectra as usize;
        let value = move |point: usize, band: usize| {
            if self.valid(seq, point) >> band & 1 == 1 { self.unit(seq, 13, point * BANDS + band) } else { f32::NAN }
        };
        (n_spectra, value)
    }
    pub fn poses(&self, seq: u64) -> Vec<StampedPose> {
        let pose = |i: u64| {
            let half = 0.05 * (seq * self.n_sweeps + i) as f64;
            let translation = self.in_odom(seq, [1.5 * i as f64, 0.0, 1.0 / 3.0]);
            let rotation = [0.0, 0.0, half.sin(), half.cos()];
            StampedPose { stamp: self.sweep_stamp(seq, i as u16), odom_from_body: PoseRow { translation, rotation } }
        };
        (0..self.n_sweeps).map(pose).collect()
    }

    pub fn send_submap(&self, bench: &mut Bench<Export>, seq: u64) {
        let stamp = self.sweep_stamp(seq, 0);
        bench.send::<TrajectoryTopic>(stamp, NoHeader::default(), self.poses(seq));
        bench.send::<SubmapTopic>(stamp, self.header(seq), self.points(seq));
    }
    pub fn send_columns(&self, bench: &mut Bench<Export>, seq: u64, topics: &[&str]) {
        for topic in topics {
            self.forward_column(bench, topic, seq);
        }
    }
    pub fn forward_column(&self, bench: &mut Bench<Export>, topic: &str, seq: u64) {
        match topic {
            "color" => bench.forward::<ColorTopic>(received(seq, ColorHeader::default(), &self.color(seq))),
            "class" => bench.forward::<ClassTopic>(received(seq, ClassHeader::default(), &self.class(seq))),
            "instance" => {
                let mut header = InstanceHeader::default();
                header.set_moving([MOVING_INSTANCE]);
                bench.forward::<InstanceTopic>(received(seq, header, &self.instance(seq)));
            }
            "material" => bench.forward::<MaterialTopic>(received(seq, MaterialHeader::default(), &self.material(seq))),
            "region" => bench.forward::<RegionTopic>(received(seq, RegionHeader::default(), &self.regions(seq))),
            "spectra" => {
                let (header, words) = self.spectra_message(seq);
                bench.forward::<SpectraTopic>(received(seq, header, &words));
            }
            _ => panic!("{topic} is not a column"),
        }
    }
}

/// A message with a sequence number chosen by the test.
pub fn received<T: Message>(seq: u64, header: T::Header, rows: &[T::Row]) -> Received<T> {
    let envelope = Envelope { seq, len: rows.len() as u32, ..Envelope::default() };
    let bytes = [bytes_from_rows(&[envelope]), bytes_from_rows(&[header]), bytes_from_rows(rows)].concat();
    Received::from_bytes(&bytes).expect("is whole")
}

/// Every file below `folder`, by name, with its bytes.
pub fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).expect("lists") {
            let path = entry.expect("lists").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("is below").to_string_lossy().into_owned();
                found.push((name, std::fs::read(path).expect("reads")));
            }
        }
    }
    found.sort();
    found
}
