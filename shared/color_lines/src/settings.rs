//! Settings of a model.

use crate::ColorLinesError;

/// Settings of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Number of hemispheres (shells of equal width around the origin), 1 to 64. With 1, a single mixture models all
    /// pixels.
    pub hemispheres: usize,
    /// Number of histogram cells along the axis of the largest extent, 2 to 128.
    pub bins: usize,
    /// Start of the Gaussians.
    pub start: Start,
    /// Weight s of the pixel coordinates relative to the bands, 0 to 10. 0: spectral information only.
    pub spatial_weight: f64,
    /// A pixel belongs only to the Gaussians of its own hemisphere (thesis: C). Otherwise all Gaussians have equal weight
    /// (NO-C).
    pub constrained: bool,
}

/// Start of the Gaussians of a mixture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// At the histogram maxima whose contrast is above this number of pixels (h-maxima), at least one per hemisphere.
    Contrast(f64),
    /// At this number of maxima, in descending order of contrast, at least one per hemisphere.
    Count(usize),
    /// At this number of k-means centers (k-means++ with this seed) of all pixels; requires one hemisphere.
    KMeans(usize, u64),
}

impl Default for Settings {
    fn default() -> Self {
        Self { hemispheres: 10, bins: 64, start: Start::Contrast(3.0), spatial_weight: 0.0, constrained: false }
    }
}

/// Largest number of Gaussians of a model.
pub const MAX_GAUSSIANS: usize = 4096;

impl Settings {
    pub(crate) fn check(&self) -> Result<(), ColorLinesError> {
        let check = |name, value: f64, range: [f64; 2], rule| {
            let is_inside = (range[0]..=range[1]).contains(&value);
            if is_inside { Ok(()) } else { Err(ColorLinesError::Setting { name, value, rule }) }
        };
        check("hemispheres", self.hemispheres as f64, [1.0, 64.0], "1 to 64")?;
        check("bins", self.bins as f64, [2.0, 128.0], "2 to 128")?;
        check("spatial weight", self.spatial_weight, [0.0, 10.0], "0 to 10")?;
        match self.start {
            Start::Contrast(h) => check("contrast", h, [0.0, 1e9], "0 to 1e9 pixels"),
            Start::Count(n) => check("number of Gaussians", n as f64, [1.0, MAX_GAUSSIANS as f64], "1 to 4096"),
            Start::KMeans(n, _) => {
                check("number of Gaussians", n as f64, [1.0, MAX_GAUSSIANS as f64], "1 to 4096")?;
                check("hemispheres", self.hemispheres as f64, [1.0, 1.0], "1 with k-means")
            }
        }
    }
}
