//! The best points found so far, as integers: the bits of the squared distance above the point number. The bits of
//! non-negative numbers have the order of the numbers, so one comparison orders by distance and then by point number.

use crate::index::Neighbor;
use std::collections::BinaryHeap;

/// Key of a point.
#[inline(always)]
pub fn key(squared_m2: f32, index: u32) -> u64 {
    u64::from(squared_m2.to_bits()) << 32 | u64::from(index)
}

/// The point of a key.
#[inline(always)]
pub fn neighbor(key: u64) -> Neighbor {
    Neighbor { index: key as u32, squared_m2: f32::from_bits((key >> 32) as u32) }
}

/// Greater than the key of every point.
const NO_POINT: u64 = 0x7f80_0000_0000_0000;

/// Keeps the smallest k keys.
pub trait Candidates {
    /// Keys from this one on are rejected.
    fn limit(&self) -> u64;
    /// Takes a key that is less than the limit.
    fn add(&mut self, key: u64);
}

/// A sorted list, for small k.
pub struct SortedList {
    keys: Vec<u64>,
}

/// Largest k for which a list is used instead of a heap.
pub const LONGEST_LIST: usize = 64;

impl SortedList {
    /// Creates an empty list for k of at least 1.
    pub fn new(k: usize) -> Self {
        Self { keys: vec![NO_POINT; k] }
    }
    /// Removes all keys.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.keys.fill(NO_POINT);
    }
    /// Keys in ascending order.
    #[inline(always)]
    pub fn keys(&self) -> &[u64] {
        &self.keys
    }
}

impl Candidates for SortedList {
    #[inline(always)]
    fn limit(&self) -> u64 {
        self.keys[self.keys.len() - 1]
    }
    #[inline(always)]
    fn add(&mut self, key: u64) {
        let mut slot = self.keys.len() - 1;
        while slot > 0 && self.keys[slot - 1] > key {
            self.keys[slot] = self.keys[slot - 1];
            slot -= 1;
        }
        self.keys[slot] = key;
    }
}

/// A heap, for any k.
pub struct Heap {
    keys: BinaryHeap<u64>,
    k: usize,
}

impl Heap {
    /// Creates an empty heap for k of at least 1.
    pub fn new(k: usize) -> Self {
        Self { keys: BinaryHeap::with_capacity(k), k }
    }
    /// Keys in ascending order; leaves the heap empty.
    pub fn take(&mut self) -> Vec<u64> {
        std::mem::take(&mut self.keys).into_sorted_vec()
    }
}

impl Candidates for Heap {
    #[inline(always)]
    fn limit(&self) -> u64 {
        if self.keys.len() < self.k { NO_POINT } else { self.keys.peek().copied().unwrap_or(NO_POINT) }
    }
    #[inline(always)]
    fn add(&mut self, key: u64) {
        if self.keys.len() == self.k {
            self.keys.pop();
        }
        self.keys.push(key);
    }
}
