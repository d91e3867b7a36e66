//! Marker-based watershed: basins grow from markers in the order of pixel values (Meyer 1991).

use crate::level::Level;
use crate::neighbors::Connectivity;
use crate::order::sorted_by;
use crate::padded::Padded;
use ndarray::Array2;

/// Every pixel of the mask that is connected with a marker gets the label of the marker whose flood reaches it first.
/// Floods continue at the lowest adjacent pixel, among equal pixels at the one that was reached first (markers in
/// raster order). 0 in `markers` means no marker, in the result no label. There are no lines between basins.
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
    let values = Padded::new(image, T::HIGHEST);
    let mut labels = Padded::new(markers, CLOSED);
    for row in 0..values.rows {
        let inside = mask.row(row);
        for (label, _) in labels.row_mut(row).iter_mut().zip(inside).filter(|(_, inside)| !**inside) {
            *label = CLOSED;
        }
    }
    if let Some(n_ranks) = T::N_RANKS {
        flood(&mut labels, connectivity, |pixel| values.pixels[pixel].rank(), n_ranks);
    } else {
        let (ranks, n_ranks) = dense_ranks(&values);
        flood(&mut labels, connectivity, |pixel| ranks[pixel], n_ranks);
    }
    labels.unframed(|label| if label == CLOSED { 0 } else { label })
}

/// Label of pixels that are not flooded.
const CLOSED: u32 = u32::MAX;

/// For each pixel, the number of lower levels in the image; and the number of levels.
fn dense_ranks<T: Level>(values: &Padded<T>) -> (Vec<u32>, usize) {
    let sorted = sorted_by(values, |rank| rank);
    let mut ranks = vec![0; values.pixels.len()];
    let mut n_lower = 0;
    for (idx, &entry) in sorted.iter().enumerate() {
        n_lower += u32::from(idx > 0 && sorted[idx - 1] >> 32 != entry >> 32);
        ranks[entry as u32 as usize] = n_lower;
    }
    (ranks, n_lower as usize + 1)
}

fn flood(labels: &mut Padded<u32>, connectivity: Connectivity, rank: impl Fn(usize) -> u32, n_ranks: usize) {
    let mut queue = LowestFirst::new(n_ranks, labels.pixels.len());
    for row in 0..labels.rows {
        let start = labels.row_start(row);
        for (i, _) in labels.row(row).iter().enumerate().filter(|(_, label)| ![0, CLOSED].contains(*label)) {
            queue.push(rank(start + i), (start + i) as u32);
        }
    }
    let steps = labels.steps(connectivity);
    while let Some(pixel) = queue.pop() {
        let label = labels.pixels[pixel as usize];
        for &step in &steps {
            let neighbor = (pixel as usize).wrapping_add_signed(step);
            if labels.pixels[neighbor] == 0 {
                labels.pixels[neighbor] = label;
                queue.push(rank(neighbor), neighbor as u32);
            }
        }
    }
}

/// Queue of pixels by rank, first in first out within a rank: a linked list per rank. A pixel is queued at most once.
struct LowestFirst {
    /// First and last pixel of each rank; 0 = empty, because pixel 0 belongs to the frame.
    ends: Vec<[u32; 2]>,
    next: Vec<u32>,
    /// A bit for each rank with pixels, then a bit for each nonzero word of these bits, and so on up to a single word.
    filled: Vec<Vec<u64>>,
    /// The lowest rank with pixels; the number of ranks if the queue is empty.
    lowest: usize,
}

impl LowestFirst {
    fn new(n_ranks: usize, n_pixels: usize) -> Self {
        let mut filled: Vec<Vec<u64>> = vec![vec![0; n_ranks.div_ceil(64)]];
        while let Some(words) = filled.last().filter(|words| words.len() > 1) {
            filled.push(vec![0; words.len().div_ceil(64)]);
        }
        Self { ends: vec![[0; 2]; n_ranks], next: vec![0; n_pixels], filled, lowest: n_ranks }
    }

    #[inline(always)]
    fn push(&mut self, rank: u32, pixel: u32) {
        let rank = rank as usize;
        let [first, last] = &mut self.ends[rank];
        if *first == 0 {
            *first = pixel;
            self.lowest = self.lowest.min(rank);
            let mut bit = rank;
            for words in &mut self.filled {
                words[bit / 64] |= 1 << (bit % 64);
                bit /= 64;
            }
        } else {
            self.next[*last as usize] = pixel;
        }
        *last = pixel;
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<u32> {
        let [first, last] = self.ends.get_mut(self.lowest)?;
        let pixel = *first;
        if pixel == *last {
            *first = 0;
            self.empty_lowest();
        } else {
            *first = self.next[pixel as usize];
        }
        Some(pixel)
    }

    fn empty_lowest(&mut self) {
        let mut bit = self.lowest;
        for words in &mut self.filled {
            words[bit / 64] &= !(1 << (bit % 64));
            if words[bit / 64] != 0 {
                break;
            }
            bit /= 64;
        }
        let is_empty = self.filled.last().is_none_or(|top| top[0] == 0);
        let lowest_below = |place: usize, words: &Vec<u64>| place * 64 + words[place].trailing_zeros() as usize;
        self.lowest = if is_empty { self.ends.len() } else { self.filled.iter().rev().fold(0, lowest_below) };
    }
}
