//! A chunk of points as a structure of arrays, so that loops over it are vectorized.

use messages::{POINT_DYNAMIC, SubmapPoint, SubmapSweep};
use pulp::{Arch, NullaryFnOnce};

/// Points per chunk: their coordinates and projections fit the second-level cache (1024 * 60 bytes), and their bounding
/// box is small. A constant, so that results do not depend on the number of threads.
pub const CHUNK: usize = 1024;

/// Loops over a chunk end at a multiple of this: four vector registers of 64 bytes.
const LANES: usize = 64;

/// One value for each point of a chunk.
pub type Lanes<T> = [T; CHUNK];

/// The values of up to [`CHUNK`] points that projection needs, and their extent.
#[derive(Debug)]
pub struct Chunk {
    /// m, submap frame. NaN, which projects into no image, behind the last point.
    pub x: Lanes<f32>,
    /// m, submap frame.
    pub y: Lanes<f32>,
    /// m, submap frame.
    pub z: Lanes<f32>,
    /// Time of each shot, s after the submap's first. NaN if the sweep of the point is unknown: its age then exceeds every limit.
    pub times: Lanes<f32>,
    /// Whether each point is on a moving object, 0 or 1: as wide as the other values.
    pub moves: Lanes<u32>,
    /// Number of points.
    pub n_points: usize,
    /// Smallest and largest coordinates, m, submap frame.
    pub bounds: [[f32; 3]; 2],
    /// First and last shot, s after the submap's first.
    pub time_span: [f32; 2],
}

impl Default for Chunk {
    /// A chunk without points.
    fn default() -> Self {
        let nowhere = [f32::NAN; CHUNK];
        Self {
            x: nowhere,
            y: nowhere,
            z: nowhere,
            times: nowhere,
            moves: [0; CHUNK],
            n_points: 0,
            bounds: [[0.0; 3]; 2],
            time_span: [0.0; 2],
        }
    }
}

impl Chunk {
    /// Replaces all points.
    pub fn refill(&mut self, points: &[SubmapPoint], sweeps: &[SubmapSweep], origin: i64) {
        self.n_points = 0;
        for point in points.iter().take(CHUNK) {
            self.push(point, time(point, sweeps, origin));
        }
        self.finish();
    }

    /// Adds a point with the time of its shot, s after the origin. Panics if there are already [`CHUNK`].
    pub fn push(&mut self, point: &SubmapPoint, time: f32) {
        let i = self.n_points;
        (self.x[i], self.y[i], self.z[i], self.times[i]) = (point.x, point.y, point.z, time);
        self.moves[i] = u32::from(point.flags & POINT_DYNAMIC != 0);
        self.n_points += 1;
    }

    /// Number of lanes that loops process: the points, and NaN up to a multiple of `LANES`.
    #[inline(always)]
    pub fn n_lanes(&self) -> usize {
        self.n_points.next_multiple_of(LANES).min(CHUNK)
    }

    /// Computes the extent after the last point was added.
    pub fn finish(&mut self) {
        let behind = self.n_points..self.n_lanes();
        for values in [&mut self.x, &mut self.y, &mut self.z, &mut self.times] {
            values[behind.clone()].fill(f32::NAN);
        }
        self.moves[behind].fill(0);
        let lanes = ..self.n_lanes();
        let spans = [&self.x, &self.y, &self.z, &self.times].map(|values| Arch::new().dispatch(Span(&values[lanes])));
        let [[x0, x1], [y0, y1], [z0, z1], time_span] = spans;
        self.bounds = [[x0, y0, z0], [x1, y1, z1]];
        self.time_span = time_span;
    }
}

/// Finds the smallest and the largest value, without NaN.
struct Span<'a>(&'a [f32]);

impl NullaryFnOnce for Span<'_> {
    type Output = [f32; 2];

    #[inline(always)]
    fn call(self) -> [f32; 2] {
        // As many at a time as a register of 64 bytes holds.
        let mut min = [f32::INFINITY; 16];
        let mut max = [f32::NEG_INFINITY; 16];
        for values in self.0.as_chunks::<16>().0 {
            for i in 0..16 {
                min[i] = if values[i] < min[i] { values[i] } else { min[i] };
                max[i] = if values[i] > max[i] { values[i] } else { max[i] };
            }
        }
        [min.into_iter().fold(f32::INFINITY, f32::min), max.into_iter().fold(f32::NEG_INFINITY, f32::max)]
    }
}

/// Seconds from `origin` to a stamp, both in ns.
#[inline]
pub fn seconds(stamp: i64, origin: i64) -> f32 {
    // A few seconds with microsecond resolution need 22 bits.
    stamp.saturating_sub(origin) as f32 * 1e-9
}

/// Distance from a time to the nearest in a span. Infinite if the span is empty.
#[inline]
pub fn gap(time: f32, [first, last]: [f32; 2]) -> f32 {
    (first - time).max(time - last).max(0.0)
}

/// Time of the shot of a point, s after `origin`. NaN if its sweep is unknown.
#[inline]
pub fn time(point: &SubmapPoint, sweeps: &[SubmapSweep], origin: i64) -> f32 {
    let Some(sweep) = sweeps.get(usize::from(point.sweep_idx)) else { return f32::NAN };
    seconds(sweep.stamp.saturating_add(i64::from(point.offset_nanos)), origin)
}
