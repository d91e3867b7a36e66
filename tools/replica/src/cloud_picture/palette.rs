//! Colors of the points of a picture.

use super::cloud_summary::CloudSummary;
use super::loaded_cloud::LoadedCloud;
use super::settings::ColorBy;
use crate::class_color::class_color;

/// Color of points that lack the attribute.
const GRAY: [u8; 3] = [90, 94, 102];

/// Viridis at five positions, dark violet to yellow: equal steps look equal, also in gray.
const RAMP: [[f64; 3]; 5] =
    [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];

/// Maps an attribute of the points to colors.
pub struct Palette {
    by: ColorBy,
    height_range: [f64; 2],
    intensity_range: [f64; 2],
}

impl Palette {
    /// The ranges are those of all clouds, so that equal values get equal colors in each.
    pub fn new(by: ColorBy, summary: &CloudSummary) -> Self {
        Self { by, height_range: summary.height_range(), intensity_range: summary.intensity_range() }
    }

    /// sRGB of a point.
    pub fn color(&self, cloud: &LoadedCloud, i: usize) -> [u8; 3] {
        match self.by {
            ColorBy::Color => cloud.color(i).unwrap_or_else(|| self.uncolored(cloud, i)),
            ColorBy::Class => cloud.classes().map_or(GRAY, |classes| class_color(classes[i])),
            ColorBy::Instance => cloud.instances().map_or(GRAY, |ids| instance_color(ids[i])),
            ColorBy::Height => ramp(share(cloud.position(i)[2], self.height_range)),
            ColorBy::Intensity => match cloud.intensities() {
                Some(intensities) => ramp(share(f64::from(intensities[i]), self.intensity_range).sqrt()),
                None => GRAY,
            },
        }
    }

    /// A dim gray by intensity, for points that no camera saw: it still shows shapes.
    fn uncolored(&self, cloud: &LoadedCloud, i: usize) -> [u8; 3] {
        let Some(intensities) = cloud.intensities() else { return GRAY };
        let level = share(f64::from(intensities[i]), self.intensity_range).sqrt();
        [52.0, 56.0, 64.0].map(|dark| (dark + 80.0 * level) as u8)
    }
}

/// Hues by the golden angle: consecutive ids get different colors.
fn instance_color(id: i64) -> [u8; 3] {
    if id == 0 {
        return GRAY;
    }
    let hue = (id as f64 * 0.618_033_988_749_895).rem_euclid(1.0) * 6.0;
    let channel = |shift: f64| {
        let distance = ((hue + shift).rem_euclid(6.0) - 3.0).abs();
        (80.0 + 170.0 * (distance - 1.0).clamp(0.0, 1.0)) as u8
    };
    [channel(0.0), channel(4.0), channel(2.0)]
}

/// Position of a value in a range, 0 to 1.
pub fn share(value: f64, [low, high]: [f64; 2]) -> f64 {
    let share = (value - low) / (high - low).max(1e-9);
    if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) }
}

/// Viridis at 0 to 1.
pub fn ramp(share: f64) -> [u8; 3] {
    let position = share * (RAMP.len() - 1) as f64;
    let index = (position as usize).min(RAMP.len() - 2);
    let rest = position - index as f64;
    std::array::from_fn(|k| (RAMP[index][k] * (1.0 - rest) + RAMP[index + 1][k] * rest) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consecutive_instances_get_different_colors() {
        assert_eq!(instance_color(0), GRAY);
        for id in 1..200 {
            let (a, b) = (instance_color(id), instance_color(id + 1));
            assert!((0..3).map(|k| a[k].abs_diff(b[k]) as u32).sum::<u32>() > 100, "{id}: {a:?} {b:?}");
        }
    }

    #[test]
    fn ramp_spans_viridis_and_nan_gets_its_start() {
        assert_eq!(ramp(0.0), [68, 1, 84]);
        assert_eq!(ramp(1.0), [253, 231, 37]);
        assert_eq!(ramp(share(f64::NAN, [0.0, 1.0])), [68, 1, 84]);
    }
}
