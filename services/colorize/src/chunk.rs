//! Points that are worked on together: their coordinates one after another, so that the loops over them are vectors.

use crate::lens::{FisheyeLens, Lens, PinholeLens};
use crate::warp_lens::WarpLens;
use messages::{POINT_DYNAMIC, SubmapPoint, SubmapSweep};
use pulp::{Arch, NullaryFnOnce};

/// Points of a chunk: their coordinates and projections fit the second cache (1024 * 60 bytes), and the box around them
/// is small. A constant, so that the work is cut in the same places whatever the number of threads.
pub const CHUNK: usize = 1024;

/// Loops over a chunk end at a multiple of this: four registers of 64 bytes.
const LANES: usize = 64;

/// One value for each point of a chunk.
pub type Lanes<T> = [T; CHUNK];

/// What projecting needs of some points of a submap, and the extent of them all.
#[derive(Debug)]
pub struct Chunk {
    /// m, submap frame. NaN, which is in no image, from the last point to the last lane.
    pub x: Lanes<f32>,
    /// m, submap frame.
    pub y: Lanes<f32>,
    /// m, submap frame.
    pub z: Lanes<f32>,
    /// Shot of each point, s after the submap's first; NaN, which is near to nothing, if its sweep is not known.
    pub times: Lanes<f32>,
    /// Whether each point is on a moving object: 0 or 1, as wide as the rest.
    pub moves: Lanes<u32>,
    /// How many points there are.
    pub n_points: usize,
    /// Smallest and largest coordinates, m, submap frame.
    pub bounds: [[f32; 3]; 2],
    /// First and last shot, s after the submap's first.
    pub time_span: [f32; 2],
}

impl Default for Chunk {
    /// Without points.
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
    /// Takes other points in, in place of all that it has.
    pub fn refill(&mut self, points: &[SubmapPoint], sweeps: &[SubmapSweep], origin: i64) {
        self.n_points = points.len().min(CHUNK);
        for (i, point) in points.iter().enumerate().take(CHUNK) {
            self.x[i] = point.x;
            self.y[i] = point.y;
            self.z[i] = point.z;
            self.times[i] = time(point, sweeps, origin);
            self.moves[i] = u32::from(point.flags & POINT_DYNAMIC != 0);
        }
        self.close();
    }

    /// Takes a point of another chunk in. Panics if there are [`CHUNK`].
    pub fn push(&mut self, from: &Self, i: usize) {
        let n = self.n_points;
        (self.x[n], self.y[n], self.z[n]) = (from.x[i], from.y[i], from.z[i]);
        (self.times[n], self.moves[n]) = (from.times[i], from.moves[i]);
        self.n_points += 1;
    }

    /// Lanes that loops go over: those of the points, and some that are NaN.
    #[inline(always)]
    pub fn n_lanes(&self) -> usize {
        self.n_points.next_multiple_of(LANES).min(CHUNK)
    }

    /// Finds the extent, once all points are in.
    pub fn close(&mut self) {
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

/// Finds the smallest and the largest value. NaN is neither.
struct Span<'a>(&'a [f32]);

impl NullaryFnOnce for Span<'_> {
    type Output = [f32; 2];

    #[inline(always)]
    fn call(self) -> [f32; 2] {
        // As many at a time as a register of 64 bytes holds.
        let (mut min, mut max) = ([f32::INFINITY; 16], [f32::NEG_INFINITY; 16]);
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
#[derive(Debug)]
pub struct Projected {
    /// px; NaN where the lens does not see.
    pub u: Lanes<f32>,
    /// px; NaN where the lens does not see.
    pub v: Lanes<f32>,
    /// From the camera, m.
    pub range_m: Lanes<f32>,
}

impl Default for Projected {
    fn default() -> Self {
        Self { u: [f32::NAN; CHUNK], v: [f32::NAN; CHUNK], range_m: [f32::NAN; CHUNK] }
    }
}

impl Projected {
    /// Projects all points of the chunk.
    pub fn fill(&mut self, chunk: &Chunk, camera_from_submap: &[[f32; 4]; 3], lens: &Lens) {
        let rows = *camera_from_submap;
        match lens {
            Lens::Pinhole(lens) => Arch::new().dispatch(Project { chunk, rows, lens: lens.clone(), out: self }),
            Lens::Fisheye(lens) => Arch::new().dispatch(Project { chunk, rows, lens: lens.clone(), out: self }),
            Lens::Warp(lens) => Arch::new().dispatch(Project { chunk, rows, lens: lens.clone(), out: self }),
        }
    }
}

struct Project<'a, L> {
    chunk: &'a Chunk,
    rows: [[f32; 4]; 3],
    lens: L,
    out: &'a mut Projected,
}

trait Projection {
    fn pixel(&self, p_in_camera: [f32; 3]) -> [f32; 2];
}
impl Projection for PinholeLens {
    #[inline(always)]
    fn pixel(&self, p_in_camera: [f32; 3]) -> [f32; 2] {
        self.pixel(p_in_camera)
    }
}
impl Projection for FisheyeLens {
    #[inline(always)]
    fn pixel(&self, p_in_camera: [f32; 3]) -> [f32; 2] {
        self.pixel(p_in_camera)
    }
}

impl Projection for WarpLens {
    #[inline(always)]
    fn pixel(&self, p_in_camera: [f32; 3]) -> [f32; 2] {
        self.pixel(p_in_camera)
    }
}

impl<L: Projection> NullaryFnOnce for Project<'_, L> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { chunk, rows: [[a0, a1, a2, a3], [b0, b1, b2, b3], [c0, c1, c2, c3]], lens, out } = self;
        for i in 0..chunk.n_lanes() {
            let (px, py, pz) = (chunk.x[i], chunk.y[i], chunk.z[i]);
            let cx = a0 * px + a1 * py + a2 * pz + a3;
            let cy = b0 * px + b1 * py + b2 * pz + b3;
            let cz = c0 * px + c1 * py + c2 * pz + c3;
            let at = lens.pixel([cx, cy, cz]);
            out.u[i] = at[0];
            out.v[i] = at[1];
            out.range_m[i] = (cx * cx + cy * cy + cz * cz).sqrt();
        }
    }
}
