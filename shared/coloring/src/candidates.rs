//! The exposures from which the points of a submap may get their values.

use crate::chunk::{Chunk, gap, seconds};
use crate::exposure::PosedExposure;
use crate::points::SubmapPoints;
use crate::visibility::VisibilityMap;

/// Largest time between shot and exposure.
#[derive(Clone, Copy, Debug)]
pub struct AgeLimits {
    /// For points that stand still, s.
    pub max_age_s: f32,
    /// For points on moving objects, s.
    pub max_moving_age_s: f32,
}

impl AgeLimits {
    /// Takes both limits from settings, s. The limit for moving objects is capped at the limit for static points.
    pub fn new(max_age_s: f64, max_moving_age_s: f64) -> Self {
        Self { max_age_s: max_age_s as f32, max_moving_age_s: max_moving_age_s.min(max_age_s) as f32 }
    }

    /// The limit for a point, s. `moves` is its value in [`Chunk::moves`].
    #[inline(always)]
    pub fn max_age_s_of(self, moves: u32) -> f32 {
        if moves != 0 { self.max_moving_age_s } else { self.max_age_s }
    }
}

/// A submap and its candidate exposures.
pub struct Candidates<'a> {
    /// Points of the submap.
    pub points: &'a SubmapPoints<'a>,
    /// Candidate exposures.
    pub exposures: &'a [PosedExposure<'a>],
    /// The visibility map of each exposure, by index.
    pub visibility: &'a [VisibilityMap],
    /// Largest ages.
    pub limits: AgeLimits,
}

impl Candidates<'_> {
    /// Pixel of a point of a chunk in an exposure, if the exposure shows the point and is within its age limit.
    pub fn visible_pixel(&self, exposure: usize, chunk: &Chunk, i: usize) -> Option<[f32; 2]> {
        let visibility = &self.visibility[exposure];
        let exposure = &self.exposures[exposure];
        let p = exposure.in_camera([chunk.x[i], chunk.y[i], chunk.z[i]]);
        let pixel = exposure.lens.pixel(p);
        let age_s = (chunk.times[i] - seconds(exposure.stamp, self.points.origin)).abs();
        let sees = visibility.sees(exposure, p, pixel) && age_s <= self.limits.max_age_s_of(chunk.moves[i]);
        sees.then_some(pixel)
    }

    /// Whether an exposure may show points of the chunk, by its field of view and its time.
    pub fn may_see(&self, exposure: usize, chunk: &Chunk) -> bool {
        let exposure = &self.exposures[exposure];
        let time = seconds(exposure.stamp, self.points.origin);
        gap(time, chunk.time_span) <= self.limits.max_age_s && exposure.frustum.intersects(&chunk.bounds)
    }
}
