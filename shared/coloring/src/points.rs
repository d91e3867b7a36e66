//! The points of a submap, split into chunks.

use crate::chunk::{CHUNK, Chunk};
use messages::{RingCounts, SubmapPoint, SubmapSweep};
use rayon::prelude::*;

/// Only one of so many points occludes: a cell has several points, and gaps between cells are closed. The number has no
/// common divisor with usual numbers of rings, so that all rings contribute.
const THINNING: usize = 3;

/// Buffers that are reused for every submap: allocating this memory anew takes as long as coloring.
#[derive(Default)]
pub struct PointBuffers {
    chunks: Vec<Chunk>,
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
    /// Rings of the LiDARs.
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
        let PointBuffers { chunks, occluders } = buffers;
        chunks.resize_with(rows.len().div_ceil(CHUNK), Chunk::default);
        let pairs = chunks.par_iter_mut().zip(rows.par_chunks(CHUNK));
        pairs.for_each(|(chunk, rows)| chunk.refill(rows, sweeps, origin));
        occluders.resize_with(chunks.len().div_ceil(THINNING), Vec::new);
        let pairs = occluders.par_iter_mut().zip(chunks.par_chunks(THINNING));
        pairs.for_each(|(occluders, chunks)| thin_into(occluders, chunks));
        let time_span = chunks.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[first, last], chunk| {
            [first.min(chunk.time_span[0]), last.max(chunk.time_span[1])]
        });
        Self { rows, sweeps, origin, rings: rings.into(), buffers, time_span }
    }

    /// Rings of the LiDAR with the fewest: its points are the farthest apart.
    pub fn fewest_rings(&self) -> u32 {
        let of_sweeps = self.sweeps.iter().map(|sweep| self.rings.of(sweep.lidar)).min();
        of_sweeps.unwrap_or_else(|| self.rings.of(0))
    }

    /// First and last shot, s after the submap's first. Infinite if there are no points.
    pub fn time_span(&self) -> [f32; 2] {
        self.time_span
    }

    /// All points in their order, [`CHUNK`] per chunk.
    pub fn chunks(&self) -> &'a [Chunk] {
        &self.buffers.chunks
    }

    /// The points that occlude: all points on moving objects, because few sweeps hit those, and a part of the others.
    pub fn occluders(&self) -> impl Iterator<Item = &'a Chunk> {
        self.buffers.occluders.iter().flatten()
    }
}

/// Replaces `thinned` by the occluding points of `chunks`.
fn thin_into(thinned: &mut Vec<Chunk>, chunks: &[Chunk]) {
    let mut n_full = 0;
    thinned.resize_with(thinned.len().max(1), Chunk::default);
    thinned[0].n_points = 0;
    for (chunk, i) in chunks.iter().flat_map(|chunk| (0..chunk.n_points).map(move |i| (chunk, i))) {
        if i % THINNING == 0 || chunk.moves[i] != 0 {
            if thinned[n_full].n_points == CHUNK {
                n_full += 1;
                thinned.resize_with(thinned.len().max(n_full + 1), Chunk::default);
                thinned[n_full].n_points = 0;
            }
            thinned[n_full].push(chunk, i);
        }
    }
    thinned.truncate(n_full + 1);
    thinned.iter_mut().for_each(Chunk::finish);
}
