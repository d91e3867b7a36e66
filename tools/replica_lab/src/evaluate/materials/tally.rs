//! Counts of points by true and found material.

use crate::materials::{TownSpectra, is_held_out};
use materials::{N_MATERIALS, Probabilities, best_row};
use scores::Confusion;

/// Upper ends of the distances of [`Tally::ranges`], m.
pub const RANGES_M: [f32; 4] = [10.0, 20.0, 40.0, f32::INFINITY];
/// Lowest scores of [`Tally::by_score`].
pub const SCORES: [f32; 4] = [0.0, 0.5, 0.7, 0.9];

/// Counts of points whose true material is known.
#[derive(Clone)]
pub struct Tally {
    /// Confusion in the sun and in the shade.
    pub light: [Confusion; 2],
    /// Confusion on surfaces of the training data, and on other surfaces.
    pub surfaces: [Confusion; 2],
    /// Confusion by distance.
    pub ranges: [Confusion; RANGES_M.len()],
    /// Confusion of points with at least this score.
    pub by_score: [Confusion; SCORES.len()],
}

impl Tally {
    /// A tally without points.
    pub fn new() -> Self {
        let empty = || Confusion::new(N_MATERIALS);
        Self {
            light: [empty(), empty()],
            surfaces: [empty(), empty()],
            ranges: RANGES_M.map(|_| empty()),
            by_score: SCORES.map(|_| empty()),
        }
    }

    /// Adds the points of a submap.
    pub fn add(&mut self, town: &TownSpectra, found: &[Probabilities]) {
        for (i, (surface, found)) in town.surfaces.iter().zip(found).enumerate() {
            let Some((surface, truth)) = surface.and_then(|surface| Some((surface, surface.material.id()?))) else {
                continue;
            };
            let row = best_row(found);
            let truth = truth as usize;
            let predicted = usize::from(row.material_id);
            self.light[usize::from(!surface.is_sunlit)].add(truth, predicted);
            self.surfaces[usize::from(is_held_out(surface.material))].add(truth, predicted);
            let range_m = town.range_m(i);
            let range = RANGES_M.iter().position(|end| range_m < *end).unwrap_or(RANGES_M.len() - 1);
            self.ranges[range].add(truth, predicted);
            for (least, confusion) in SCORES.iter().zip(&mut self.by_score) {
                if f32::from(row.score) >= least * 255.0 {
                    confusion.add(truth, predicted);
                }
            }
        }
    }

    /// Confusion of all points.
    pub fn all(&self) -> Confusion {
        let mut all = self.light[0].clone();
        all.merge(&self.light[1]);
        all
    }
}
