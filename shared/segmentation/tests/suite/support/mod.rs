//! Labeled clouds and models for the tests.

use ground::Parameters;
use messages::{ClassId, ClassRow, SubmapHeader, SubmapPoint};
use segmentation::ground_quasi_flat::encode;
use segmentation::{ModelInput, Segmenter};
use std::path::PathBuf;

/// Points, and whether they are ground; `None` without a label.
#[derive(Default)]
pub struct LabeledCloud {
    pub points: Vec<SubmapPoint>,
    pub is_ground: Vec<Option<bool>>,
}

impl LabeledCloud {
    pub fn push(&mut self, [x, y, z]: [f32; 3], is_ground: Option<bool>) {
        self.points.push(SubmapPoint { x, y, z, ..SubmapPoint::default() });
        self.is_ground.push(is_ground);
    }
}

/// Confusion matrix of ground for all labeled points.
#[derive(Clone, Copy, Debug, Default)]
pub struct GroundConfusion {
    pub true_positives: usize,
    pub false_negatives: usize,
    pub false_positives: usize,
    pub true_negatives: usize,
}

impl GroundConfusion {
    pub fn new(cloud: &LabeledCloud, classes: &[ClassRow]) -> Self {
        let mut confusion = Self::default();
        for (truth, row) in cloud.is_ground.iter().zip(classes) {
            match (truth, row.class_id == ClassId::Ground as u8) {
                (Some(true), true) => confusion.true_positives += 1,
                (Some(true), false) => confusion.false_negatives += 1,
                (Some(false), true) => confusion.false_positives += 1,
                (Some(false), false) => confusion.true_negatives += 1,
                (None, _) => {}
            }
        }
        confusion
    }
    pub fn n(&self) -> usize {
        self.true_positives + self.false_negatives + self.false_positives + self.true_negatives
    }
    pub fn accuracy(&self) -> f64 {
        (self.true_positives + self.true_negatives) as f64 / self.n() as f64
    }
    pub fn recall(&self) -> f64 {
        self.true_positives as f64 / (self.true_positives + self.false_negatives) as f64
    }
    /// Intersection over union of ground.
    pub fn iou(&self) -> f64 {
        self.true_positives as f64 / (self.true_positives + self.false_negatives + self.false_positives) as f64
    }
    pub fn plus(self, other: Self) -> Self {
        Self {
            true_positives: self.true_positives + other.true_positives,
            false_negatives: self.false_negatives + other.false_negatives,
            false_positives: self.false_positives + other.false_positives,
            true_negatives: self.true_negatives + other.true_negatives,
        }
    }
}

/// The ground model of the project.
pub fn shipped_model() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/ground.safetensors"))
}

/// A model with these parameters, written to a file and read back.
pub fn model_of(parameters: &Parameters) -> Box<dyn Segmenter> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("model.safetensors");
    std::fs::write(&path, encode(parameters).expect("encodes")).expect("writes");
    segmentation::load(&path, &segmentation::Options::default()).expect("loads")
}

/// Classes of points without a header: the path of the LiDAR is unknown.
pub fn classes_of(model: &dyn Segmenter, points: &[SubmapPoint]) -> Vec<ClassRow> {
    let header = SubmapHeader::default();
    let mut classes = vec![ClassRow::default(); points.len()];
    model.segment(&ModelInput::new(&header, points), &mut classes).expect("segments");
    classes
}
