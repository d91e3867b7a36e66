//! Clouds for the tests.
#![allow(dead_code, reason = "each test file uses its own part")]

use learning::ground::Parameters;
use learning::{Cloud, Segmenter};
use messages::{ClassId, ClassRow, SubmapHeader, SubmapPoint};
use std::path::PathBuf;

/// Points, and which of them are ground in truth; `None` where the truth does not say.
#[derive(Default)]
pub struct LabelledCloud {
    pub points: Vec<SubmapPoint>,
    pub is_ground: Vec<Option<bool>>,
}

impl LabelledCloud {
    pub fn push(&mut self, [x, y, z]: [f32; 3], is_ground: Option<bool>) {
        self.points.push(SubmapPoint { x, y, z, ..SubmapPoint::default() });
        self.is_ground.push(is_ground);
    }
}

/// Outcomes of all points whose truth is known.
#[derive(Clone, Copy, Debug, Default)]
pub struct Confusion {
    pub hits: usize,
    pub misses: usize,
    pub false_alarms: usize,
    pub rejections: usize,
}

impl Confusion {
    pub fn of(cloud: &LabelledCloud, classes: &[ClassRow]) -> Self {
        let mut confusion = Self::default();
        for (truth, row) in cloud.is_ground.iter().zip(classes) {
            match (truth, row.class_id == ClassId::Ground as u8) {
                (Some(true), true) => confusion.hits += 1,
                (Some(true), false) => confusion.misses += 1,
                (Some(false), true) => confusion.false_alarms += 1,
                (Some(false), false) => confusion.rejections += 1,
                (None, _) => {}
            }
        }
        confusion
    }
    pub fn n(&self) -> usize {
        self.hits + self.misses + self.false_alarms + self.rejections
    }
    pub fn accuracy(&self) -> f64 {
        (self.hits + self.rejections) as f64 / self.n() as f64
    }
    pub fn recall(&self) -> f64 {
        self.hits as f64 / (self.hits + self.misses) as f64
    }
    /// Of ground, over union.
    pub fn iou(&self) -> f64 {
        self.hits as f64 / (self.hits + self.misses + self.false_alarms) as f64
    }
    pub fn plus(self, other: Self) -> Self {
        Self {
            hits: self.hits + other.hits,
            misses: self.misses + other.misses,
            false_alarms: self.false_alarms + other.false_alarms,
            rejections: self.rejections + other.rejections,
        }
    }
}

/// The model that the project ships.
pub fn shipped_model() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/ground.safetensors"))
}

/// A model of these parameters, by way of a file.
pub fn model_of(parameters: &Parameters) -> Box<dyn Segmenter> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("model.safetensors");
    std::fs::write(&path, parameters.to_bytes().expect("encodes")).expect("writes");
    learning::load(&path, &learning::Options::default()).expect("loads")
}

/// Classes without a header: the sensor's path is not known.
pub fn classes_of(model: &dyn Segmenter, points: &[SubmapPoint]) -> Vec<ClassRow> {
    let header = SubmapHeader::default();
    let mut classes = vec![ClassRow::default(); points.len()];
    model.segment(&Cloud { header: &header, points, colors: None }, &mut classes).expect("segments");
    classes
}

/// Uniform numbers in 0 to 1 (`SplitMix64`).
pub struct Random(pub u64);
impl Random {
    pub fn uniform(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.uniform()
    }
}
