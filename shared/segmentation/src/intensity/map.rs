//! Conversion of the intensities of a submap.

/// Conversion of each intensity of a submap.
#[derive(Clone, Debug, PartialEq)]
pub enum IntensityMap {
    /// The intensity is unchanged.
    Unchanged,
    /// The intensity is replaced by the training value at the same quantile of the ground: values by intensity for each
    /// ring. The last ring's values also apply to the rings above.
    ByRing(Vec<[u8; 256]>),
    /// The intensity is unknown.
    Unknown,
}

impl IntensityMap {
    /// Converts a known intensity.
    pub fn apply(&self, ring: usize, intensity: u8) -> u8 {
        match self {
            Self::Unchanged => intensity,
            Self::ByRing(maps) => {
                maps.get(ring).or(maps.last()).map_or(intensity, |values| values[usize::from(intensity)])
            }
            Self::Unknown => 0,
        }
    }
}
