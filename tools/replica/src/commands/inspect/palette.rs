//! Colors of points.

use super::By;
use super::cloud::Cloud;
use super::survey::Survey;

/// sRGB of the class ids, as CARLA shows them; unlabeled is gray there where CARLA has black.
const CLASS_COLORS: [[u8; 3]; 23] = [
    [96, 96, 100],
    [110, 110, 118],
    [190, 153, 153],
    [55, 90, 80],
    [220, 20, 60],
    [190, 190, 190],
    [157, 234, 50],
    [128, 64, 128],
    [244, 35, 232],
    [107, 142, 35],
    [40, 70, 230],
    [102, 102, 156],
    [220, 220, 0],
    [70, 130, 180],
    [110, 40, 110],
    [150, 100, 100],
    [230, 150, 140],
    [180, 165, 180],
    [250, 170, 30],
    [110, 190, 160],
    [170, 120, 50],
    [45, 60, 150],
    [145, 170, 100],
];

/// What has no color of its own.
const GRAY: [u8; 3] = [90, 94, 102];

/// Five colors from dark violet to yellow (viridis): equal steps look equal, also in gray.
const RAMP: [[f64; 3]; 5] =
    [[68.0, 1.0, 84.0], [59.0, 82.0, 139.0], [33.0, 145.0, 140.0], [94.0, 201.0, 98.0], [253.0, 231.0, 37.0]];

/// Gives points their colors.
pub struct Painter {
    by: By,
    height_range: [f64; 2],
    intensity_range: [f64; 2],
}

impl Painter {
    /// Ranges are those of the whole set, so that clouds fit together.
    pub fn new(by: By, survey: &Survey) -> Self {
        Self { by, height_range: survey.height_range(), intensity_range: survey.intensity_range() }
    }

    /// sRGB of a point.
    pub fn color(&self, cloud: &Cloud, i: usize) -> [u8; 3] {
        match self.by {
            By::Color => cloud.color(i).unwrap_or_else(|| self.unseen(cloud, i)),
            By::Class => cloud.classes().map_or(GRAY, |classes| class_color(classes[i])),
            By::Instance => cloud.instances().map_or(GRAY, |ids| instance_color(ids[i])),
            By::Height => ramp(share(cloud.position(i)[2], self.height_range)),
            By::Intensity => match cloud.intensities() {
                Some(intensities) => ramp(share(f64::from(intensities[i]), self.intensity_range).sqrt()),
                None => GRAY,
            },
        }
    }

    /// Where no camera looked, a dim gray by intensity still shows the shapes.
    fn unseen(&self, cloud: &Cloud, i: usize) -> [u8; 3] {
        let Some(intensities) = cloud.intensities() else { return GRAY };
        let level = share(f64::from(intensities[i]), self.intensity_range).sqrt();
        [52.0, 56.0, 64.0].map(|dark| (dark + 80.0 * level) as u8)
    }
}

/// sRGB of a class id.
pub fn class_color(class: u8) -> [u8; 3] {
    CLASS_COLORS.get(usize::from(class)).copied().unwrap_or(GRAY)
}

/// Hues by the golden angle: ids next to each other look different.
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

fn share(value: f64, [low, high]: [f64; 2]) -> f64 {
    let share = (value - low) / (high - low).max(1e-9);
    if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) }
}

fn ramp(share: f64) -> [u8; 3] {
    let place = share * (RAMP.len() - 1) as f64;
    let index = (place as usize).min(RAMP.len() - 2);
    let rest = place - index as f64;
    std::array::from_fn(|k| (RAMP[index][k] * (1.0 - rest) + RAMP[index + 1][k] * rest) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_class_has_a_color_of_its_own() {
        assert_eq!(CLASS_COLORS.len(), messages::ClassId::ALL.len());
        for (index, color) in CLASS_COLORS.iter().enumerate() {
            assert!(!CLASS_COLORS[..index].contains(color), "class {index}");
        }
    }

    #[test]
    fn neighboring_instances_differ_and_none_is_gray() {
        assert_eq!(instance_color(0), GRAY);
        for id in 1..200 {
            let (a, b) = (instance_color(id), instance_color(id + 1));
            assert!((0..3).map(|k| a[k].abs_diff(b[k]) as u32).sum::<u32>() > 100, "{id}: {a:?} {b:?}");
        }
    }

    #[test]
    fn the_ramp_goes_from_end_to_end() {
        assert_eq!(ramp(0.0), [68, 1, 84]);
        assert_eq!(ramp(1.0), [253, 231, 37]);
        assert_eq!(ramp(share(f64::NAN, [0.0, 1.0])), [68, 1, 84]);
    }
}
