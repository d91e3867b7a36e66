//! Voxels and a fast hash set of them.

use std::hash::{BuildHasher, Hasher};

/// Voxel of a regular grid. Indices wrap at 2^20 voxels from the origin: 200 km for voxels of 0.2 m.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct VoxelIndex(pub [i32; 3]);

impl VoxelIndex {
    /// The voxel around `p` in a grid of `1 / per_m` metres.
    #[inline]
    pub fn containing(p: [f64; 3], per_m: f64) -> Self {
        Self(p.map(|v| floor(v * per_m)))
    }
    /// Key with 21 bits of each index; never [`EMPTY_KEY`].
    #[inline]
    pub fn key(self) -> u64 {
        let bits = |i: i32| u64::from(i as u32) & 0x1f_ffff;
        bits(self.0[0]) | bits(self.0[1]) << 21 | bits(self.0[2]) << 42
    }
    /// The inverse of [`VoxelIndex::key`].
    pub fn from_key(key: u64) -> Self {
        // Drops the upper bits and extends the sign from bit 20.
        Self([0, 21, 42].map(|shift| ((key >> shift) as i32) << 11 >> 11))
    }
}

/// `v.floor() as i32` without the function call that processors before SSE 4.1 need.
#[inline]
fn floor(v: f64) -> i32 {
    let towards_zero = v as i32;
    towards_zero.saturating_sub(i32::from(f64::from(towards_zero) > v))
}

/// Not the key of any voxel: keys have 63 bits.
const EMPTY_KEY: u64 = u64::MAX;

/// Fibonacci hashing: neighbors differ in the upper bits.
#[inline]
fn spread(key: u64) -> u64 {
    // Folding mixes the z bits, which the product would leave in the top bits only.
    (key ^ (key >> 31)).wrapping_mul(0x9e37_79b9_7f4a_7c15)
}

/// Hasher of voxel keys for the tables of the standard library: four times as fast as their default.
#[derive(Clone, Debug, Default)]
pub(crate) struct SpreadKeys;

/// State of [`SpreadKeys`].
pub(crate) struct SpreadKey(u64);

impl BuildHasher for SpreadKeys {
    type Hasher = SpreadKey;

    fn build_hasher(&self) -> SpreadKey {
        SpreadKey(0)
    }
}

impl Hasher for SpreadKey {
    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.write_u64(self.0 ^ u64::from(*byte));
        }
    }
    #[inline]
    fn write_u64(&mut self, key: u64) {
        let product = spread(key);
        // Tables use the lowest bits, which a product does not mix.
        self.0 = product ^ product >> 32;
    }
    fn finish(&self) -> u64 {
        self.0
    }
}

/// A power of two with room for `n` keys at half load; at least 2 so that shifts stay valid.
fn table_bits(n: usize) -> u32 {
    (n * 2).next_power_of_two().trailing_zeros().max(1)
}

/// A set of voxels with a fixed capacity.
pub(crate) struct VoxelSet {
    bits: u32,
    keys: Vec<u64>,
}

impl VoxelSet {
    /// Creates a set with room for `n` voxels.
    pub fn for_at_most(n: usize) -> Self {
        let bits = table_bits(n);
        Self { bits, keys: vec![EMPTY_KEY; 1 << bits] }
    }
    /// Inserts a voxel and returns whether it is new.
    pub fn insert(&mut self, voxel: VoxelIndex) -> bool {
        let key = voxel.key();
        let slot = self.slot(key);
        let is_new = self.keys[slot] == EMPTY_KEY;
        self.keys[slot] = key;
        is_new
    }
    /// Slot of the key, or the slot where it would be inserted.
    #[inline]
    fn slot(&self, key: u64) -> usize {
        let mut slot = (spread(key) >> (64 - self.bits)) as usize;
        while self.keys[slot] != key && self.keys[slot] != EMPTY_KEY {
            slot = (slot + 1) & (self.keys.len() - 1);
        }
        slot
    }
}

/// Indices of the first point in each voxel of side `spacing_m`, in order.
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
    fn thinning_keeps_the_first_point_of_each_voxel() {
        let points = [[0.01, 0.0, 0.0], [0.09, 0.0, 0.0], [-0.01, 0.0, 0.0], [0.11, 0.0, 0.0], [0.02, 0.05, 0.0]];
        assert_eq!(thinned(points.into_iter(), 0.1), [0, 2, 3]);
    }

    #[test]
    fn fast_floor_equals_floor_also_at_the_limits() {
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
    fn voxel_is_new_only_at_its_first_insertion() {
        let mut set = VoxelSet::for_at_most(9 * 9 * 9);
        for round in 0..2 {
            for i in 0..9 * 9 * 9 {
                let voxel = VoxelIndex([i / 81 - 4, i / 9 % 9 - 4, i % 9 - 4]);
                assert_eq!(set.insert(voxel), round == 0, "{voxel:?}");
            }
        }
    }
}
