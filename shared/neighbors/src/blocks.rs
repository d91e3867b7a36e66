//! Leaves of the tree: points in arrays that fill vector registers.

use crate::position::Bounds;

/// Largest number of points in a leaf.
pub const BLOCK: usize = 16;

/// The points of a leaf. Unused slots are infinitely far away.
#[derive(Clone, Debug)]
pub struct Block {
    x: [f32; BLOCK],
    y: [f32; BLOCK],
    z: [f32; BLOCK],
    /// Position of the first point in the order of the index.
    pub start: u32,
    /// Number of points.
    pub n: u32,
}

impl Block {
    /// Creates a block of at most [`BLOCK`] positions.
    pub fn new(start: u32, positions: impl Iterator<Item = [f32; 3]>) -> Self {
        let [x, y, z] = [[f32::INFINITY; BLOCK]; 3];
        let mut block = Self { x, y, z, start, n: 0 };
        for p in positions.take(BLOCK) {
            let slot = block.n as usize;
            [block.x[slot], block.y[slot], block.z[slot]] = p;
            block.n += 1;
        }
        block
    }
    /// Positions of the points.
    pub fn positions(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        (0..self.n as usize).map(|slot| [self.x[slot], self.y[slot], self.z[slot]])
    }
    /// Box around the points.
    pub fn bounds(&self) -> Bounds {
        Bounds::around(self.positions())
    }
    /// [`crate::squared_distance`] to each point; infinite for unused slots.
    #[inline(always)]
    pub fn squared_distances(&self, q: [f32; 3]) -> [f32; BLOCK] {
        let mut squared = [0.0; BLOCK];
        for (slot, squared) in squared.iter_mut().enumerate() {
            *squared = crate::squared_distance([self.x[slot], self.y[slot], self.z[slot]], q);
        }
        squared
    }
}
