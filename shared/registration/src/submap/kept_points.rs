//! The points of a sweep that go into a submap.

use crate::{Sweep, thinned};

/// The points of a sweep that go into a submap; independent of the motion.
#[derive(Clone, Debug)]
pub struct KeptPoints {
    /// Indices of the points, ascending.
    pub indices: Vec<usize>,
    /// Number of dropped points: too near, or not finite.
    pub n_dropped: usize,
    /// See [`Sweep::incidences`].
    pub incidences: Vec<f32>,
}

impl KeptPoints {
    /// Selects the finite points from `min_range_m` on. One of each voxel of `thin_m` is kept; 0 keeps all.
    pub fn select(sweep: &Sweep, min_range_m: f64, thin_m: f64) -> Self {
        let points = sweep.points();
        let is_in_range = |idx: &usize| {
            let [x, y, z] = points[*idx].position;
            let squared = x * x + y * y + z * z;
            squared.is_finite() && squared >= (min_range_m * min_range_m) as f32
        };
        let in_range: Vec<usize> = (0..points.len()).filter(is_in_range).collect();
        let n_dropped = points.len() - in_range.len();
        let indices = if thin_m == 0.0 {
            in_range
        } else {
            let firsts = thinned(in_range.iter().map(|&idx| points[idx].position), thin_m);
            firsts.into_iter().map(|first| in_range[first]).collect()
        };
        Self { indices, n_dropped, incidences: sweep.incidences() }
    }
}
