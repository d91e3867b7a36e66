//! Intensities of the ground: counts and quantiles.

/// Shares of the ground points whose intensities are compared.
const SHARES: [f32; N] = [0.05, 0.25, 0.5, 0.75, 0.95];
pub(super) const N: usize = 5;

/// Intensities of the ground below which 5, 25, 50, 75 and 95 % of its points lie.
pub type GroundIntensities = [u8; N];

/// Largest distance from the ground of points that count as ground, m.
const GROUND_M: f32 = 0.15;
/// With fewer ground points the scale is unknown.
const MIN_POINTS: u64 = 2000;

/// Counts the intensities of ground points.
#[derive(Clone, Debug)]
pub struct GroundHistogram([u64; 256]);

impl Default for GroundHistogram {
    fn default() -> Self {
        Self([0; 256])
    }
}

impl GroundHistogram {
    /// Adds a point with its height above the ground, m.
    pub fn add(&mut self, intensity: u8, height_m: f32) {
        if height_m.abs() < GROUND_M {
            self.0[usize::from(intensity)] += 1;
        }
    }
    /// Adds points of one intensity.
    pub(super) fn add_counts(&mut self, intensity: u8, n: u64) {
        self.0[usize::from(intensity)] += n;
    }
    /// Number of points per intensity.
    pub(super) fn counts(&self) -> &[u64; 256] {
        &self.0
    }
    /// Adds the counts of another histogram.
    pub fn join(&mut self, other: &Self) {
        self.0.iter_mut().zip(other.0).for_each(|(sum, n)| *sum += n);
    }
    /// Share of the points that have the largest intensity of all.
    pub(super) fn share_of_largest(&self) -> f64 {
        let total: u64 = self.0.iter().sum();
        let at_largest = self.0.iter().rev().find(|n| **n > 0).copied().unwrap_or(0);
        at_largest as f64 / total.max(1) as f64
    }
    /// The quantiles; `None` if there are too few points, or all have intensity 0.
    pub fn quantiles(&self) -> Option<GroundIntensities> {
        let total: u64 = self.0.iter().sum();
        if total < MIN_POINTS || self.0[0] == total {
            return None;
        }
        Some(SHARES.map(|share| {
            let wanted = (f64::from(share) * total as f64) as u64;
            let mut sum = 0;
            let reached = |n: &u64| {
                sum += n;
                sum > wanted
            };
            self.0.iter().position(reached).unwrap_or(255) as u8
        }))
    }
}
