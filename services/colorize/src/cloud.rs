//! A submap, its points cut into chunks.

use crate::chunk::{CHUNK, Chunk};
use messages::{SubmapPoint, SubmapSweep};
use rayon::prelude::*;

/// Every so manyth point hides: there are several in a cell, and its neighbors close what is missing. A number without a common divisor
/// with those of rings, so that all of them hide.
const THINNING: usize = 3;

/// What every submap uses again: the system takes as long to give such memory as coloring does.
#[derive(Default)]
pub struct Memory {
    chunks: Vec<Chunk>,
    /// Of every [`THINNING`] chunks.
    occluders: Vec<Vec<Chunk>>,
}

/// A submap.
pub struct Cloud<'a> {
    /// All points, in place.
    pub points: &'a [SubmapPoint],
    /// The sweeps that they are of.
    pub sweeps: &'a [SubmapSweep],
    /// First shot, from which times count, ns since the Unix epoch.
    pub origin: i64,
    /// Rings of the sensor.
    pub n_rings: u32,
    memory: &'a Memory,
    time_span: [f32; 2],
}

impl<'a> Cloud<'a> {
    /// Looks at every point once. What was in the memory is gone.
    pub fn new(
        points: &'a [SubmapPoint],
        sweeps: &'a [SubmapSweep],
        origin: i64,
        n_rings: u32,
        memory: &'a mut Memory,
    ) -> Self {
        let Memory { chunks, occluders } = memory;
        chunks.resize_with(points.len().div_ceil(CHUNK), Chunk::default);
        let pairs = chunks.par_iter_mut().zip(points.par_chunks(CHUNK));
        pairs.for_each(|(chunk, points)| chunk.refill(points, sweeps, origin));
        occluders.resize_with(chunks.len().div_ceil(THINNING), Vec::new);
        let pairs = occluders.par_iter_mut().zip(chunks.par_chunks(THINNING));
        pairs.for_each(|(occluders, chunks)| thin_into(occluders, chunks));
        let time_span = chunks.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[first, last], chunk| {
            [first.min(chunk.time_span[0]), last.max(chunk.time_span[1])]
        });
        Self { points, sweeps, origin, n_rings, memory, time_span }
    }

    /// First and last shot, s after the submap's first; of no points, infinite.
    pub fn time_span(&self) -> [f32; 2] {
        self.time_span
    }

    /// The chunks in their order.
    pub fn chunks(&self) -> &'a [Chunk] {
        &self.memory.chunks
    }

    /// The points that hide: all those on moving objects, which few sweeps meet, and some of the rest.
    pub fn occluders(&self) -> impl Iterator<Item = &'a Chunk> {
        self.memory.occluders.iter().flatten()
    }
}

/// Those of the points that hide, in place of what was in `thinned`.
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
    thinned.iter_mut().for_each(Chunk::close);
}
