//! The rim of the LiDAR hits in an exposure, where the background may be visible behind a point.

use crate::visibility::VisibilityMap;
use morphology::{dilate, erode};

/// Width of the rim on both sides, cells: 0.3 m at a range of 10 m. The sky is visible through foliage less than half a
/// metre thick, such as the outer part of a round crown.
const WIDTH: usize = 9;

/// The LiDAR hits in a cell of an exposure and up to `WIDTH` cells around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surroundings {
    /// Only cells with hits.
    Surface,
    /// Cells with and without hits.
    Rim,
    /// No hits.
    Nothing,
}

/// The surroundings of every cell of an exposure.
#[derive(Debug)]
pub struct RimMap {
    /// Surroundings of each cell, row by row.
    surroundings: Vec<Surroundings>,
}

impl RimMap {
    /// Classifies the cells of a visibility map.
    pub fn new(visibility: &VisibilityMap) -> Self {
        let is_hit = visibility.is_hit();
        let all = erode(&is_hit, WIDTH);
        let some = dilate(&is_hit, WIDTH);
        let of_cell = |(all, some): (&bool, &bool)| match (all, some) {
            (true, _) => Surroundings::Surface,
            (false, true) => Surroundings::Rim,
            (false, false) => Surroundings::Nothing,
        };
        Self { surroundings: all.iter().zip(&some).map(of_cell).collect() }
    }

    /// The surroundings of a cell; [`Surroundings::Nothing`] outside of the image.
    pub fn surroundings(&self, cell: u32) -> Surroundings {
        self.surroundings.get(cell as usize).copied().unwrap_or(Surroundings::Nothing)
    }
}
