//! The points of a submap, split into chunks.

use crate::chunk::{CHUNK, Chunk, time};
use messages::{POINT_DYNAMIC, RingCounts, SubmapPoint, SubmapSweep};
use rayon::prelude::*;

/// One point in this many occludes: a cell has several points, and gaps between cells are closed. The number shares no
/// divisor with usual numbers of rings, so that all rings contribute.
const THINNING: usize = 3;

/// Buffers that are reused for every submap: allocating this memory again takes as long as coloring.
#[derive(Default)]
pub struct PointBuffers {
    /// One list for every [`THINNING`] chunks.
    occluders: Vec<Vec<Chunk>>,
}

/// The points of a submap.
pub struct SubmapPoints<'a> {
    /// All points, in place.
    pub rows: &'a [SubmapPoint],
    /// The sweeps of the submap.
    pub sweeps: &'a [SubmapSweep],
    /// First shot, the origin of times, ns since the Unix epoch.
    pub origin: i64,
    /// Number of rings of each LiDAR.
    pub rings: RingCounts,
    buffers: &'a PointBuffers,
    time_span: [f32; 2],
}

impl<'a> SubmapPoints<'a> {
    /// Reads every point once and overwrites the buffers.
    pub fn new(
        rows: &'a [SubmapPoint],
        sweeps: &'a [SubmapSweep],
        origin: i64,
        rings: impl Into<RingCounts>,
        buffers: &'a mut PointBuffers,
    ) -> Self {
        let PointBuffers { occluders } = buffers;
        occluders.resize_with(rows.len().div_ceil(CHUNK * THINNING), Vec::new);
        let thin = |(occluders, rows): (&mut Vec<Chunk>, &[SubmapPoint])| thin_into(occluders, rows, sweeps, origin);
        let pairs = occluders.par_iter_mut().zip(rows.par_chunks(CHUNK * THINNING));
        let spans = pairs.map(thin);
        let time_span = spans.reduce(|| NEVER, |[first, last], [start, end]| [first.min(start), last.max(end)]);
        Self { rows, sweeps, origin, rings: rings.into(), buffers, time_span }
    }

    /// Number of rings of the LiDAR with the fewest: its points have the largest spacing.
    pub fn fewest_rings(&self) -> u32 {
        let of_sweeps = self.sweeps.iter().map(|sweep| self.rings.get(sweep.lidar)).min();
        of_sweeps.unwrap_or_else(|| self.rings.get(0))
    }

    /// First and last shot, s after the submap's first. Infinite if there are no points.
    pub fn time_span(&self) -> [f32; 2] {
        self.time_span
    }

    /// Number of chunks. Each holds [`CHUNK`] consecutive points.
    pub fn n_chunks(&self) -> usize {
        self.rows.len().div_ceil(CHUNK)
    }

    /// Reads a chunk. Keeping all chunks would save a few percent of the time and take two thirds more memory.
    ///
    /// # Panics
    /// If there is no such chunk.
    pub fn read_chunk(&self, index: usize, into: &mut Chunk) {
        let rows = &self.rows[index * CHUNK..];
        into.refill(&rows[..rows.len().min(CHUNK)], self.sweeps, self.origin);
    }

    /// The points that occlude: all points on moving objects, because few sweeps hit them, and a subset of the others.
    pub fn occluders(&self) -> impl Iterator<Item = &'a Chunk> {
        self.buffers.occluders.iter().flatten()
    }
}

/// The time span of an empty set of points.
const NEVER: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

/// Replaces `thinned` by the points of `rows` that occlude. Returns the first and last shot of all.
fn thin_into(thinned: &mut Vec<Chunk>, rows: &[SubmapPoint], sweeps: &[SubmapSweep], origin: i64) -> [f32; 2] {
    let [mut first, mut last] = NEVER;
    let mut n_full = 0;
    thinned.resize_with(thinned.len().max(1), Chunk::default);
    thinned[0].n_points = 0;
    for (i, point) in rows.iter().enumerate() {
        let time = time(point, sweeps, origin);
        first = first.min(time);
        last = last.max(time);
        if (i % CHUNK).is_multiple_of(THINNING) || point.flags & POINT_DYNAMIC != 0 {
            if thinned[n_full].n_points == CHUNK {
                n_full += 1;
                thinned.resize_with(thinned.len().max(n_full + 1), Chunk::default);
                thinned[n_full].n_points = 0;
            }
            thinned[n_full].push(point, time);
        }
    }
    thinned.truncate(n_full + 1);
    thinned.iter_mut().for_each(Chunk::finish);
    [first, last]
}
