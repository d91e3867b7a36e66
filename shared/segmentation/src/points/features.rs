//! Features of points, the inputs of networks on points.

use super::cells::CellCloud;
use serde::{Deserialize, Serialize};

/// A feature of a point. Unknown values are 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PointFeature {
    /// Constant 1.
    One,
    /// Position relative to the center of the sphere, m: x, y, z.
    Offset,
    /// Height above the ground: `tanh(height / 0.3 m)` resolves curbs, and height / 4 m, -1 to 3.
    Height,
    /// Return strength / 50, and 1 if intensities are known.
    Intensity,
    /// Red, green, blue of 0 to 1, and height above the ground, m.
    ColorHeight,
}

/// Largest offset, m. Points beyond are outside all useful spheres.
const FARTHEST_M: f32 = 1e4;

impl PointFeature {
    /// Number of values.
    fn n_values(self) -> usize {
        match self {
            Self::One => 1,
            Self::Height | Self::Intensity => 2,
            Self::Offset => 3,
            Self::ColorHeight => 4,
        }
    }
    /// Number of values of a point.
    pub fn channels(features: &[Self]) -> usize {
        features.iter().map(|feature| feature.n_values()).sum()
    }
    /// Appends the values of a point.
    fn add(self, cloud: &CellCloud, point: usize, values: &mut Vec<f32>) {
        let height_m = cloud.heights_m[point];
        match self {
            Self::One => values.push(1.0),
            Self::Offset => values.extend(cloud.positions[point].map(|v| v.clamp(-FARTHEST_M, FARTHEST_M))),
            Self::Height => values.extend([(height_m / 0.3).tanh(), (height_m / 4.0).clamp(-1.0, 3.0)]),
            Self::Intensity => match cloud.intensities.get(point) {
                Some(intensity) => values.extend([intensity / 50.0, 1.0]),
                None => values.extend([0.0, 0.0]),
            },
            Self::ColorHeight => {
                let color = cloud.colors.get(point).copied().unwrap_or_default();
                values.extend(color);
                values.push(height_m.clamp(-FARTHEST_M, FARTHEST_M));
            }
        }
    }
}

impl CellCloud {
    /// The features of all points, one point after the other.
    pub fn features(&self, features: &[PointFeature]) -> Vec<f32> {
        let mut values = Vec::with_capacity(self.len() * PointFeature::channels(features));
        for point in 0..self.len() {
            for feature in features {
                feature.add(self, point, &mut values);
            }
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::PointFeature::{ColorHeight, Height, Intensity, Offset, One};
    use super::*;

    #[test]
    fn features_of_a_point_follow_their_order() {
        let mut cloud = CellCloud {
            positions: vec![[1.0, -2.0, 3.0]],
            heights_m: vec![2.0],
            intensities: vec![25.0],
            colors: vec![[0.25, 0.5, 1.0]],
        };
        let features = [One, Intensity, Offset, ColorHeight, Height];
        assert_eq!(PointFeature::channels(&features), 12);
        let values = cloud.features(&features);
        assert_eq!(values[..10], [1.0, 0.5, 1.0, 1.0, -2.0, 3.0, 0.25, 0.5, 1.0, 2.0]);
        assert!((values[10] - (2.0_f32 / 0.3).tanh()).abs() < 1e-6 && values[11] == 0.5, "{values:?}");
        cloud.intensities = Vec::new();
        cloud.colors = Vec::new();
        assert_eq!(cloud.features(&[Intensity, ColorHeight]), [0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
    }
}
