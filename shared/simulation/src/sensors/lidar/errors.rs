//! Errors of a real unit: deviations of its beams from its factory table.

use lidar::velodyne::Model;
use random::{gauss, hash, unit};
use std::fmt::Write;

/// Magnitudes of the errors of a unit. `drive.toml` and the packets keep the nominal beams; the ground truth keeps the
/// true geometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LidarErrors {
    /// Seed of the unit: units with the same seed have the same errors in every drive.
    pub unit_seed: u64,
    /// Elevation error common to all rings, degrees: its absolute value is between half of this and this, its sign is
    /// random.
    pub common_elevation_deg: f64,
    /// Elevation error of a ring, degrees (standard deviation).
    pub ring_elevation_deg: f64,
    /// Range error of a ring, m (standard deviation).
    pub ring_range_m: f64,
    /// Gain error of a ring's intensity as a share (standard deviation).
    pub ring_gain: f64,
    /// Gain error of all intensities as a share (standard deviation).
    pub common_gain: f64,
}

settings::words! {
    /// Quality grades of LiDAR units.
    pub enum LidarGrade {
        /// A perfect unit.
        None = "none",
        /// A good unit: rings are off by up to 0.1 degrees and 2 cm.
        Typical = "typical",
        /// All rings are off by 0.1 to 0.2 degrees, each ring by up to 0.2 degrees more and 3 cm.
        Poor = "poor",
    }
}

impl LidarGrade {
    /// Errors of a unit of this grade.
    pub const fn errors(self) -> LidarErrors {
        match self {
            Self::None => LidarErrors::NONE,
            Self::Typical => LidarErrors::TYPICAL,
            Self::Poor => LidarErrors::POOR,
        }
    }
}

/// Errors are limited to this number of standard deviations.
const LARGEST_SIGMAS: f32 = 2.0;

impl LidarErrors {
    /// A perfect unit.
    pub const NONE: Self = Self {
        unit_seed: 1,
        common_elevation_deg: 0.0,
        ring_elevation_deg: 0.0,
        ring_range_m: 0.0,
        ring_gain: 0.0,
        common_gain: 0.0,
    };
    /// A good unit, similar to an HDL-32E: its rings are off by up to 0.1 degrees.
    pub const TYPICAL: Self = Self {
        common_elevation_deg: 0.04,
        ring_elevation_deg: 0.03,
        ring_range_m: 0.01,
        ring_gain: 0.1,
        common_gain: 0.1,
        ..Self::NONE
    };
    /// A unit similar to KITTI's HDL-64E, whose rings are all off by 0.2 degrees (`CT-ICP`, Dellenbach et al., ICRA 2022,
    /// and `KISS-ICP` correct this), and each by up to 0.2 degrees more.
    pub const POOR: Self = Self {
        common_elevation_deg: 0.2,
        ring_elevation_deg: 0.1,
        ring_range_m: 0.015,
        ring_gain: 0.2,
        common_gain: 0.2,
        ..Self::NONE
    };

    /// Errors of the lasers of a unit, by their number in [`Model::lasers`].
    pub(super) fn per_laser(&self, model: Model) -> Vec<LaserError> {
        let random = |kind: u64, sigma: f64| {
            let sigmas = gauss(hash(self.unit_seed ^ 0x0011_da12, kind)).clamp(-LARGEST_SIGMAS, LARGEST_SIGMAS);
            f64::from(sigmas) * sigma
        };
        let share = f64::from(unit(hash(self.unit_seed ^ 0x0011_da12, 0)));
        let common_deg = self.common_elevation_deg * if share < 0.5 { -0.5 - share } else { share };
        let common_gain = 1.0 + random(1, self.common_gain);
        let laser = |laser: u64| LaserError {
            elevation_deg: common_deg + random(10 + 3 * laser, self.ring_elevation_deg),
            range_m: random(11 + 3 * laser, self.ring_range_m),
            gain: (common_gain * (1.0 + random(12 + 3 * laser, self.ring_gain))).max(0.1),
        };
        (0..model.n_rings() as u64).map(laser).collect()
    }

    /// The errors as a table, rings from the lowest to the highest; `None` for a perfect unit.
    pub fn csv(&self, model: Model) -> Option<String> {
        let is_perfect = Self { unit_seed: Self::NONE.unit_seed, ..*self } == Self::NONE;
        if is_perfect {
            return None;
        }
        let mut lasers: Vec<_> = model.rings().into_iter().zip(self.per_laser(model)).collect();
        lasers.sort_by_key(|(ring, _)| *ring);
        let mut text = String::from("ring,elevation_error_deg,range_error_m,intensity_gain\n");
        for (ring, LaserError { elevation_deg, range_m, gain }) in lasers {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{ring},{elevation_deg:.5},{range_m:.5},{gain:.4}");
        }
        Some(text)
    }
}

impl Default for LidarErrors {
    fn default() -> Self {
        Self::NONE
    }
}

/// Errors of one laser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LaserError {
    /// True minus nominal elevation.
    pub elevation_deg: f64,
    /// Reported minus true range.
    pub range_m: f64,
    /// Factor of the intensity.
    pub gain: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Statistics {
        mean: f64,
        deviation: f64,
    }

    fn statistics(values: impl Iterator<Item = f64>) -> Statistics {
        let values: Vec<f64> = values.collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        Statistics { mean, deviation: (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt() }
    }

    #[test]
    fn unit_errors_repeat_with_their_seed_and_differ_between_seeds() {
        let unit = |unit_seed| LidarErrors { unit_seed, ..LidarErrors::POOR }.per_laser(Model::Hdl64e);
        assert_eq!(unit(7), unit(7));
        assert_ne!(unit(7), unit(8));
        assert_eq!(LidarErrors::NONE.csv(Model::Hdl64e), None);
        assert_eq!(LidarErrors { unit_seed: 9, ..LidarErrors::NONE }.csv(Model::Vlp16), None);
        let table = LidarErrors::TYPICAL.csv(Model::Hdl32e).expect("errors");
        assert_eq!(table.lines().count(), 33);
        assert!(table.lines().nth(1).is_some_and(|line| line.starts_with("0,")), "{table}");
    }

    #[test]
    fn unit_errors_have_the_sizes_of_their_grade() {
        let mut signs = [0; 2];
        for unit_seed in 0..40 {
            let poor = LidarErrors { unit_seed, ..LidarErrors::POOR }.per_laser(Model::Hdl64e);
            let Statistics { mean: common, deviation: ring } = statistics(poor.iter().map(|laser| laser.elevation_deg));
            signs[usize::from(common > 0.0)] += 1;
            assert!((0.06..0.26).contains(&common.abs()), "{common}");
            assert!((0.06..0.13).contains(&ring), "{ring}");
            let Statistics { deviation: range, .. } = statistics(poor.iter().map(|laser| laser.range_m));
            assert!((0.009..0.02).contains(&range), "{range}");
            let typical = LidarErrors { unit_seed, ..LidarErrors::TYPICAL }.per_laser(Model::Hdl32e);
            assert_eq!(typical.len(), 32);
            assert!(typical.iter().all(|laser| laser.elevation_deg.abs() <= 0.1 && laser.range_m.abs() <= 0.02));
        }
        assert!(signs.iter().all(|n| *n > 10), "{signs:?}");
    }
}
