//! What becomes of the intensities of a submap.

/// What becomes of each intensity of a submap.
#[derive(Clone, Debug, PartialEq)]
pub enum IntensityMap {
    /// It stays.
    Unchanged,
    /// It gets the value of the training at the same share of the ground: values by intensity for each ring, the last ones also for
    /// the rings above.
    ByRing(Vec<[u8; 256]>),
    /// It is not known.
    Unknown,
}

impl IntensityMap {
    /// What becomes of an intensity that is known.
    pub fn of_intensity(&self, ring: usize, intensity: u8) -> u8 {
        match self {
            Self::Unchanged => intensity,
            Self::ByRing(maps) => {
                maps.get(ring).or(maps.last()).map_or(intensity, |values| values[usize::from(intensity)])
            }
            Self::Unknown => 0,
        }
    }
}
