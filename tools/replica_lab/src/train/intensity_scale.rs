//! The scale of the intensities of labeled points.

use super::recipe_data::RecordingSource;
use messages::SubmapPoint;
use segmentation::intensity::{GroundHistogram, GroundIntensities, IntensityMap, IntensityUse, SubmapIntensities};

/// Origin of the intensities of labeled points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum IntensityScale {
    /// Intensities of the training: they count for its scale.
    Own,
    /// Intensities of another sensor. They are scaled to the training, as in `infer`, by the intensities of the ground in the
    /// training.
    Foreign(Option<GroundIntensities>),
}

impl IntensityScale {
    /// Scale of a recording; `ground` has the intensities of the sources before it. Classes are predicted for drives of other
    /// sensors.
    pub fn for_source(source: &RecordingSource, ground: &GroundHistogram) -> Self {
        match source.predicted_above {
            Some(_) => Self::Foreign(ground.quantiles()),
            None => Self::Own,
        }
    }
    /// The map for the intensities of a submap.
    pub fn map(self, points: &[SubmapPoint], heights_m: &[f32]) -> IntensityMap {
        match self {
            Self::Own => IntensityMap::Unchanged,
            Self::Foreign(trained) => SubmapIntensities::find(IntensityUse::Normalized, points, heights_m, trained).map,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn predicted_classes_have_intensities_of_another_sensor() {
        let source = |predicted_above| RecordingSource {
            file: "run.mcap".into(),
            drive: None,
            predicted_above,
            validation: false,
            weight: 1.0,
            every: 1,
        };
        let mut ground = GroundHistogram::default();
        (0..5000).for_each(|i| ground.add(8 + (i % 9) as u8, 0.0));
        assert_eq!(IntensityScale::for_source(&source(None), &ground), IntensityScale::Own);
        let scale = IntensityScale::for_source(&source(Some(0.9)), &ground);
        assert_eq!(scale, IntensityScale::Foreign(ground.quantiles()));
        // Five times as bright.
        let point = |i: usize| SubmapPoint { intensity: 40 + 5 * (i % 9) as u8, ..SubmapPoint::default() };
        let points: Vec<SubmapPoint> = (0..5000).map(point).collect();
        let heights_m = vec![0.0; points.len()];
        let map = scale.map(&points, &heights_m);
        assert_eq!([40, 60, 80].map(|intensity| map.apply(0, intensity)), [8, 12, 16]);
        assert_eq!(IntensityScale::Own.map(&points, &heights_m), IntensityMap::Unchanged);
    }
}
