//! Submaps of real sensors with the true class of each point.

use super::labels::Labels;
use super::tally::{Tally, TrueClass};
use messages::{ClassRow, SubmapHeader, SubmapPoint};
use segmentation::{ModelInput, Segmenter};

/// A submap with its truth.
pub struct LabelledSubmap {
    pub header: Box<SubmapHeader>,
    pub points: Vec<SubmapPoint>,
    /// The class of each point; `None` if it is not scored.
    pub truth: Vec<Option<TrueClass>>,
}

impl LabelledSubmap {
    /// Adds the classes that a model gives to the points. Classes that the labels do not distinguish are merged.
    pub fn score(&self, tally: &mut Tally, model: &dyn Segmenter, labels: Labels) -> anyhow::Result<()> {
        let mut classes = vec![ClassRow::default(); self.points.len()];
        model.segment(&ModelInput::new(&self.header, &self.points), &mut classes)?;
        for ((point, row), truth) in self.points.iter().zip(classes).zip(&self.truth) {
            let Some(truth) = *truth else { continue };
            let predicted = ClassRow { class_id: labels.merged(row.class_id), ..row };
            tally.add(truth, predicted, range_m(&self.header, point));
        }
        Ok(())
    }
}

/// Distance of a point from the LiDAR at the start of its sweep, m.
pub fn range_m(header: &SubmapHeader, point: &SubmapPoint) -> f32 {
    let [x, y, z, ..] = header.sweeps[usize::from(point.sweep_idx)].submap_from_lidar_begin;
    let [x, y, z] = [point.x - x, point.y - y, point.z - z];
    (x * x + y * y + z * z).sqrt()
}
