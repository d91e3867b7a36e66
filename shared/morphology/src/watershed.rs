//! Watershed by markers: basins grow from markers in the order of the pixels' values (Meyer 1991).

use crate::padded::Padded;
use crate::{Connectivity, Level};
use ndarray::Array2;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Every pixel of the mask that can be reached from a marker gets the label of the marker whose flood comes first; floods go
/// on at the lowest pixel beside them, and among equals at the one that was reached first (markers in raster order). 0 is no
/// marker, and no label; there are no lines between basins.
///
/// # Panics
/// If the images differ in size.
pub fn watershed<T: Level>(
    image: &Array2<T>,
    markers: &Array2<u32>,
    mask: &Array2<bool>,
    connectivity: Connectivity,
) -> Array2<u32> {
    assert_eq!(image.dim(), markers.dim(), "image and markers differ in size");
    assert_eq!(image.dim(), mask.dim(), "image and mask differ in size");
    let values = Padded::of(image, T::HIGHEST);
    let mut labels = Padded::of(markers, CLOSED);
    for row in 0..values.rows {
        let inside = mask.row(row);
        for (label, _) in labels.row_mut(row).iter_mut().zip(inside).filter(|(_, inside)| !**inside) {
            *label = CLOSED;
        }
    }
    if let Some(n_ranks) = T::N_RANKS {
        flood(&values, &mut labels, connectivity, Buckets::new(n_ranks, values.pixels.len()));
    } else {
        let ranks = image.iter().map(|value| value.rank());
        flood(&values, &mut labels, connectivity, ByAge::new(ranks));
    }
    labels.unframed(|label| if label == CLOSED { 0 } else { label })
}

/// Where no flood comes.
const CLOSED: u32 = u32::MAX;

fn flood<T: Level>(
    values: &Padded<T>,
    labels: &mut Padded<u32>,
    connectivity: Connectivity,
    mut queue: impl LowestFirst,
) {
    for row in 0..labels.rows {
        let start = labels.row_start(row);
        for (i, _) in labels.row(row).iter().enumerate().filter(|(_, label)| ![0, CLOSED].contains(*label)) {
            queue.push(values.pixels[start + i].rank(), (start + i) as u32);
        }
    }
    let steps = values.steps(connectivity);
    while let Some(pixel) = queue.pop() {
        let label = labels.pixels[pixel as usize];
        for &step in &steps {
            let neighbor = (pixel as usize).wrapping_add_signed(step);
            if labels.pixels[neighbor] == 0 {
                labels.pixels[neighbor] = label;
                queue.push(values.pixels[neighbor].rank(), neighbor as u32);
            }
        }
    }
}

/// Pixels by rank, and by age among those of one rank. No pixel comes twice.
trait LowestFirst {
    fn push(&mut self, rank: u32, pixel: u32);
    fn pop(&mut self) -> Option<u32>;
}

/// One chain of pixels for each rank.
struct Buckets {
    /// First and last pixel of each rank; 0 is none, as pixel 0 lies in the frame.
    ends: Vec<[u32; 2]>,
    next: Vec<u32>,
    /// No pixel has a lower rank.
    lowest: usize,
}

impl Buckets {
    fn new(n_ranks: usize, n_pixels: usize) -> Self {
        Self { ends: vec![[0; 2]; n_ranks], next: vec![0; n_pixels], lowest: 0 }
    }
}

impl LowestFirst for Buckets {
    #[inline(always)]
    fn push(&mut self, rank: u32, pixel: u32) {
        let [first, last] = &mut self.ends[rank as usize];
        if *first == 0 {
            *first = pixel;
        } else {
            self.next[*last as usize] = pixel;
        }
        *last = pixel;
        self.lowest = self.lowest.min(rank as usize);
    }
    #[inline(always)]
    fn pop(&mut self) -> Option<u32> {
        let skipped = self.ends[self.lowest..].iter().position(|[first, _]| *first != 0);
        let Some(skipped) = skipped else {
            self.lowest = self.ends.len();
            return None;
        };
        self.lowest += skipped;
        let [first, last] = &mut self.ends[self.lowest];
        let pixel = *first;
        *first = if pixel == *last { 0 } else { self.next[pixel as usize] };
        Some(pixel)
    }
}

/// Many small heaps of rank and age, each for a range of ranks.
struct ByAge {
    heaps: Vec<BinaryHeap<Reverse<u64>>>,
    /// Pixel by age.
    pixels: Vec<u32>,
    least: u32,
    /// From a rank above `least` to its heap.
    shift: u32,
    /// A bit for each heap that is not empty, and one for each word of these bits.
    filled: [Vec<u64>; 2],
}

/// Heaps at most: 64 words of 64 words of bits.
const N_HEAPS: u32 = 1 << 16;

impl ByAge {
    fn new(ranks: impl Iterator<Item = u32>) -> Self {
        let (least, most) = ranks.fold((u32::MAX, 0), |(least, most), rank| (least.min(rank), most.max(rank)));
        let span = most.saturating_sub(least);
        let shift = (u32::BITS - span.leading_zeros()).saturating_sub(N_HEAPS.ilog2());
        let n_heaps = (span >> shift) as usize + 1;
        let words = n_heaps.div_ceil(64);
        Self {
            heaps: vec![BinaryHeap::new(); n_heaps],
            pixels: Vec::new(),
            least,
            shift,
            filled: [vec![0; words], vec![0; words.div_ceil(64)]],
        }
    }
}

impl LowestFirst for ByAge {
    #[inline(always)]
    fn push(&mut self, rank: u32, pixel: u32) {
        let heap_idx = ((rank - self.least) >> self.shift) as usize;
        self.heaps[heap_idx].push(Reverse(u64::from(rank) << 32 | self.pixels.len() as u64));
        self.pixels.push(pixel);
        self.filled[0][heap_idx / 64] |= 1 << (heap_idx % 64);
        self.filled[1][heap_idx / 4096] |= 1 << (heap_idx / 64 % 64);
    }
    #[inline(always)]
    fn pop(&mut self) -> Option<u32> {
        let top = self.filled[1].iter().position(|&word| word != 0)?;
        let word_idx = top * 64 + self.filled[1][top].trailing_zeros() as usize;
        let heap_idx = word_idx * 64 + self.filled[0][word_idx].trailing_zeros() as usize;
        let heap = &mut self.heaps[heap_idx];
        let Reverse(key) = heap.pop()?;
        if heap.is_empty() {
            self.filled[0][word_idx] &= !(1 << (heap_idx % 64));
            if self.filled[0][word_idx] == 0 {
                self.filled[1][top] &= !(1 << (word_idx % 64));
            }
        }
        Some(self.pixels[(key & u64::from(u32::MAX)) as usize])
    }
}
