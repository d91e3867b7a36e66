//! Cubes of space and a fast set of them.

/// Cube of a regular grid. Indices wrap at 2^20 cubes from the origin: 200 km for cubes of 0.2 m.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct VoxelIndex(pub [i32; 3]);

impl VoxelIndex {
    /// The cube around `p` in a grid of `1 / per_m` metres.
    #[inline]
    pub fn containing(p: [f64; 3], per_m: f64) -> Self {
        Self(p.map(|v| floor(v * per_m)))
    }
    /// 21 bits of each index; never [`EMPTY_KEY`].
    #[inline]
    pub fn key(self) -> u64 {
        let bits = |i: i32| u64::from(i as u32) & 0x1f_ffff;
        bits(self.0[0]) | bits(self.0[1]) << 21 | bits(self.0[2]) << 42
    }
}

/// `v.floor() as i32` without the call of a function that processors before SSE 4.1 need.
#[inline]
fn floor(v: f64) -> i32 {
    let towards_zero = v as i32;
    towards_zero.saturating_sub(i32::from(f64::from(towards_zero) > v))
}

/// No voxel has it: keys have 63 bits.
pub(crate) const EMPTY_KEY: u64 = u64::MAX;

/// Where the search for a key starts in a table of `1 << bits` slots: Fibonacci hashing spreads neighbors well.
#[inline]
pub(crate) fn first_slot(key: u64, bits: u32) -> usize {
    // Folding mixes the z bits, which the product alone would leave in the top only.
    ((key ^ (key >> 31)).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (64 - bits)) as usize
}

/// A power of two with room for `n` keys at half load; at least 2 so that shifts stay valid.
pub(crate) fn table_bits(n: usize) -> u32 {
    (n * 2).next_power_of_two().trailing_zeros().max(1)
}

/// Voxels seen so far, at most as many as it was made for.
pub(crate) struct VoxelSet {
    bits: u32,
    keys: Vec<u64>,
}

impl VoxelSet {
    /// Room for `n` voxels.
    pub fn for_at_most(n: usize) -> Self {
        let bits = table_bits(n);
        Self { bits, keys: vec![EMPTY_KEY; 1 << bits] }
    }
    /// Whether the voxel is new.
    pub fn insert(&mut self, voxel: VoxelIndex) -> bool {
        let key = voxel.key();
        let slot = self.slot(key);
        let is_new = self.keys[slot] == EMPTY_KEY;
        self.keys[slot] = key;
        is_new
    }
    /// Whether the voxel was seen.
    pub fn contains(&self, voxel: VoxelIndex) -> bool {
        self.keys[self.slot(voxel.key())] != EMPTY_KEY
    }
    /// Where the key is, or where it would go.
    #[inline]
    fn slot(&self, key: u64) -> usize {
        let mut slot = first_slot(key, self.bits);
        while self.keys[slot] != key && self.keys[slot] != EMPTY_KEY {
            slot = (slot + 1) & (self.keys.len() - 1);
        }
        slot
    }
}

/// Indices of the points that are the first in their cube of side `spacing_m`, in order.
pub fn thinned(points: impl ExactSizeIterator<Item = [f32; 3]>, spacing_m: f64) -> Vec<usize> {
    let mut taken = VoxelSet::for_at_most(points.len());
    let per_m = 1.0 / spacing_m;
    points
        .enumerate()
        .filter(|(_, point)| taken.insert(VoxelIndex::containing(point.map(f64::from), per_m)))
        .map(|(point_idx, _)| point_idx)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_point_per_cube_is_left() {
        let points = [[0.01, 0.0, 0.0], [0.09, 0.0, 0.0], [-0.01, 0.0, 0.0], [0.11, 0.0, 0.0], [0.02, 0.05, 0.0]];
        assert_eq!(thinned(points.into_iter(), 0.1), [0, 2, 3]);
    }

    #[test]
    fn cubes_are_half_open_and_far_ones_do_not_overflow() {
        for v in [
            -2.0,
            -1.5,
            -1.0,
            -0.1,
            -0.0,
            0.0,
            0.9,
            1.0,
            7.99,
            1e300,
            -1e300,
            f64::NAN,
            2_147_483_647.5,
            -2_147_483_648.5,
        ] {
            assert_eq!(floor(v), v.floor() as i32, "{v}");
        }
    }

    #[test]
    fn every_voxel_is_new_once() {
        let mut set = VoxelSet::for_at_most(9 * 9 * 9);
        for round in 0..2 {
            for i in 0..9 * 9 * 9 {
                let voxel = VoxelIndex([i / 81 - 4, i / 9 % 9 - 4, i % 9 - 4]);
                assert_eq!(set.contains(voxel), round == 1, "{voxel:?}");
                assert_eq!(set.insert(voxel), round == 0, "{voxel:?}");
            }
        }
    }
}
