//! Points that are worked on together: their coordinates one after another, so that the loops over them are vectors.

use crate::lens::Lens;
use messages::{POINT_DYNAMIC, SubmapPoint, SubmapSweep};
use rayon::prelude::*;

/// Points of a chunk: their coordinates and projections fit the second cache (1024 * 48 bytes), and the box around them
/// is small. A constant, so that the work is cut in the same places whatever the number of threads.
pub const CHUNK: usize = 1024;

/// A submap in place.
pub struct Cloud<'a> {
    /// All points.
    pub points: &'a [SubmapPoint],
    /// The sweeps that they are of.
    pub sweeps: &'a [SubmapSweep],
    /// First shot, from which times count, ns since the Unix epoch.
    pub origin: i64,
    /// Rings of the sensor.
    pub n_rings: u32,
    /// Where and when each [`CHUNK`] of the points is.
    extents: Vec<Extent>,
}

/// Where and when the points of a chunk are.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Smallest and largest coordinates, m, submap frame.
    pub bounds: [[f32; 3]; 2],
    /// First and last shot, s after the submap's first.
    pub time_span: [f32; 2],
}

impl<'a> Cloud<'a> {
    /// Looks at every point once.
    pub fn new(points: &'a [SubmapPoint], sweeps: &'a [SubmapSweep], origin: i64, n_rings: u32) -> Self {
        let extents = points.par_chunks(CHUNK).map(|points| Extent::new(points, sweeps, origin)).collect();
        Self { points, sweeps, origin, n_rings, extents }
    }
    /// The chunks in their order.
    pub fn extents(&self) -> &[Extent] {
        &self.extents
    }
}

impl Extent {
    fn new(points: &[SubmapPoint], sweeps: &[SubmapSweep], origin: i64) -> Self {
        let (mut min, mut max) = ([f32::INFINITY; 4], [f32::NEG_INFINITY; 4]);
        for point in points {
            let at = [point.x, point.y, point.z, time(point, sweeps, origin)];
            // NaN counts for neither.
            for i in 0..4 {
                min[i] = if at[i] < min[i] { at[i] } else { min[i] };
                max[i] = if at[i] > max[i] { at[i] } else { max[i] };
            }
        }
        let [x0, y0, z0, first] = min;
        let [x1, y1, z1, last] = max;
        Self { bounds: [[x0, y0, z0], [x1, y1, z1]], time_span: [first, last] }
    }
}

/// Some points of a submap. Filled anew for every chunk, because memory that is used again stays in the cache.
#[derive(Debug, Default)]
pub struct Chunk {
    /// m, submap frame.
    pub x: Vec<f32>,
    /// m, submap frame.
    pub y: Vec<f32>,
    /// m, submap frame.
    pub z: Vec<f32>,
    /// Shot of each point, s after the submap's first; NaN, which is near to nothing, if its sweep is not known.
    pub times: Vec<f32>,
    /// Whether each point is on a moving object.
    pub moves: Vec<bool>,
}

impl Chunk {
    /// Takes other points of the cloud in.
    pub fn fill(&mut self, cloud: &Cloud<'_>, points: &[SubmapPoint]) {
        let n = points.len();
        for values in [&mut self.x, &mut self.y, &mut self.z, &mut self.times] {
            values.resize(n, 0.0);
        }
        self.moves.resize(n, false);
        let (x, y, z) = (&mut self.x[..n], &mut self.y[..n], &mut self.z[..n]);
        let (times, moves) = (&mut self.times[..n], &mut self.moves[..n]);
        for (i, point) in points.iter().enumerate() {
            x[i] = point.x;
            y[i] = point.y;
            z[i] = point.z;
            times[i] = time(point, cloud.sweeps, cloud.origin);
            moves[i] = point.flags & POINT_DYNAMIC != 0;
        }
    }
    /// How many points there are.
    pub fn len(&self) -> usize {
        self.times.len()
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
    }
}

/// Seconds from `origin` to a stamp, both in ns.
pub fn seconds(stamp: i64, origin: i64) -> f32 {
    // Some seconds to the microsecond are 22 bits.
    stamp.saturating_sub(origin) as f32 * 1e-9
}

#[inline]
fn time(point: &SubmapPoint, sweeps: &[SubmapSweep], origin: i64) -> f32 {
    let Some(sweep) = sweeps.get(usize::from(point.sweep_idx)) else { return f32::NAN };
    seconds(sweep.stamp.saturating_add(i64::from(point.offset_nanos)), origin)
}

/// Where the points of a chunk fall on an image.
#[derive(Debug, Default)]
pub struct Projected {
    /// px; NaN where the lens does not see.
    pub u: Vec<f32>,
    /// px; NaN where the lens does not see.
    pub v: Vec<f32>,
    /// From the camera, m.
    pub range_m: Vec<f32>,
}

impl Projected {
    /// Projects all points of the chunk.
    pub fn fill(&mut self, chunk: &Chunk, camera_from_submap: &[[f32; 4]; 3], lens: &Lens) {
        match lens {
            Lens::Pinhole(lens) => self.fill_by(chunk, camera_from_submap, |p| lens.pixel(p)),
            Lens::Fisheye(lens) => self.fill_by(chunk, camera_from_submap, |p| lens.pixel(p)),
        }
    }

    #[inline]
    fn fill_by(&mut self, chunk: &Chunk, rows: &[[f32; 4]; 3], pixel: impl Fn([f32; 3]) -> [f32; 2]) {
        let n = chunk.len();
        for values in [&mut self.u, &mut self.v, &mut self.range_m] {
            values.resize(n, 0.0);
        }
        let (x, y, z) = (&chunk.x[..n], &chunk.y[..n], &chunk.z[..n]);
        let (u, v, range_m) = (&mut self.u[..n], &mut self.v[..n], &mut self.range_m[..n]);
        let [[a0, a1, a2, a3], [b0, b1, b2, b3], [c0, c1, c2, c3]] = *rows;
        for i in 0..n {
            let (px, py, pz) = (x[i], y[i], z[i]);
            let cx = a0 * px + a1 * py + a2 * pz + a3;
            let cy = b0 * px + b1 * py + b2 * pz + b3;
            let cz = c0 * px + c1 * py + c2 * pz + c3;
            let at = pixel([cx, cy, cz]);
            u[i] = at[0];
            v[i] = at[1];
            range_m[i] = (cx * cx + cy * cy + cz * cz).sqrt();
        }
    }
}
