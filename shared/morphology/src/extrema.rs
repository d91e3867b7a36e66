//! Regional extrema: plateaus without a higher (lower) neighbor, and h-maxima.

#![allow(clippy::needless_bitwise_bool, reason = "a branch per pixel would prevent vectorization")]

use crate::blocks::{BLOCK, block, block_mut, in_blocks};
use crate::level::Level;
use crate::neighbors::Connectivity;
use crate::padded::Padded;
use crate::reconstruction::reconstruct_by_dilation;
use ndarray::{Array2, Zip};

/// Pixels of plateaus whose neighbors are all lower. A constant image is one maximum.
pub fn regional_maxima<T: Level>(image: &Array2<T>, connectivity: Connectivity) -> Array2<bool> {
    maxima(&Padded::new(image, T::LOWEST), connectivity)
}

/// Pixels of plateaus whose neighbors are all higher. A constant image is one minimum.
pub fn regional_minima<T: Level>(image: &Array2<T>, connectivity: Connectivity) -> Array2<bool> {
    maxima(&Padded::mapped(image, T::LOWEST, T::complement), connectivity)
}

/// A pixel value that can be lowered by a height.
pub trait Height: Level {
    /// `self - height`, not below [`Level::LOWEST`].
    #[must_use]
    fn lowered(self, height: Self) -> Self;
}

macro_rules! heights {
    ($($t:ty),*) => {$(
        impl Height for $t {
            #[inline(always)]
            fn lowered(self, height: Self) -> Self {
                self.saturating_sub(height)
            }
        }
    )*};
}
heights!(u8, u16, u32);

impl Height for f32 {
    #[inline(always)]
    fn lowered(self, height: Self) -> Self {
        self - height
    }
}

/// H-maxima: peaks of at least `height` above the highest saddle to a higher peak. They are the pixels at least `height` above the
/// reconstruction of the image lowered by `height` (Soille 2003, section 6.3.4). Integers below the minimum of their type plus `height`
/// cannot be lowered enough and give no peaks.
pub fn h_maxima<T: Height>(image: &Array2<T>, height: T, connectivity: Connectivity) -> Array2<bool> {
    let lowered = image.mapv(|value| value.lowered(height));
    let reconstructed = reconstruct_by_dilation(&lowered, image, connectivity);
    Zip::from(image).and(&reconstructed).map_collect(|&value, &base| value > base && value.lowered(height) >= base)
}

fn maxima<T: Level>(image: &Padded<T>, connectivity: Connectivity) -> Array2<bool> {
    // The frame excludes no pixel: it has the lowest value and is a candidate.
    let mut candidates = Padded::filled((image.rows, image.cols), true);
    let mut stack: Vec<u32> = Vec::new();
    wide_loops::run(
        #[inline(always)]
        || sweep_down(image, &mut candidates, connectivity),
    );
    wide_loops::run(
        #[inline(always)]
        || sweep_up(image, &mut candidates, connectivity, &mut stack),
    );
    // From here on, the frame must not be entered.
    candidates.fill_frame(false);
    let steps = image.steps(connectivity);
    while let Some(pixel) = stack.pop() {
        let pixel = pixel as usize;
        for &step in &steps {
            let neighbor = pixel.wrapping_add_signed(step);
            if candidates.pixels[neighbor] && image.pixels[neighbor] == image.pixels[pixel] {
                candidates.pixels[neighbor] = false;
                stack.push(neighbor as u32);
            }
        }
    }
    candidates.unframed(|is_maximum| is_maximum)
}

/// Candidates are the pixels without a higher neighbor. A pixel that is not a candidate excludes its plateau, downwards
/// and sideways. [`sweep_up`] does the same upwards. The two sweeps determine most plateaus.
#[inline(always)]
fn sweep_down<T: Level>(image: &Padded<T>, candidates: &mut Padded<bool>, connectivity: Connectivity) {
    let mut scratch = vec![false; image.cols];
    for row in 0..image.rows {
        exclude_lower(image, row, candidates.row_mut(row), connectivity);
        let (above, here) = candidates.pixels.split_at_mut((row + 1) * image.stride);
        let [up, ..] = image.three_rows(row);
        let here = &mut here[1..=image.cols];
        exclude_across(image.row(row), up, &above[row * image.stride..], here, connectivity);
        exclude_along(image.row(row), here, &mut scratch);
    }
}

/// Appends pixels that may still exclude others to `edges`.
#[inline(always)]
fn sweep_up<T: Level>(
    image: &Padded<T>,
    candidates: &mut Padded<bool>,
    connectivity: Connectivity,
    edges: &mut Vec<u32>,
) {
    let n = image.cols;
    let stride = image.stride;
    let mut scratch = vec![false; n];
    for row in (0..image.rows).rev() {
        let (here, below) = candidates.pixels.split_at_mut((row + 2) * stride);
        let [_, _, down] = image.three_rows(row);
        let here = &mut here[(row + 1) * stride..][1..=n];
        exclude_across(image.row(row), down, &below[..stride], here, connectivity);
        exclude_along(image.row(row), here, &mut scratch);
        if row + 1 < image.rows {
            find_edges(image, candidates, row + 1, connectivity, &mut scratch, edges);
        }
    }
    if image.rows > 0 {
        find_edges(image, candidates, 0, connectivity, &mut scratch, edges);
    }
}

#[inline(always)]
fn exclude_lower<T: Level>(image: &Padded<T>, row: usize, into: &mut [bool], connectivity: Connectivity) {
    let lines = image.three_rows(row);
    in_blocks!(image.cols, exclude_lower_in_block(lines, into, connectivity));
}

#[inline(always)]
fn exclude_lower_in_block<T: Level, const N: usize>(
    start: usize,
    lines: [&[T]; 3],
    into: &mut [bool],
    connectivity: Connectivity,
) {
    let [up, at, down] = lines.map(|line| neighbors::<T, N>(line, start));
    let mut highest: [T; N] = *up[1];
    let mut raise = |others: &[T; N]| highest.iter_mut().zip(others).for_each(|(high, &other)| *high = high.sup(other));
    [down[1], at[0], at[2]].into_iter().for_each(&mut raise);
    if connectivity == Connectivity::Eight {
        [up[0], up[2], down[0], down[2]].into_iter().for_each(&mut raise);
    }
    *block_mut(into, start) = std::array::from_fn::<bool, N, _>(|i| highest[i] <= at[1][i]);
}

/// `N` pixels of a framed row at offsets `start`, `start + 1` and `start + 2`.
#[inline(always)]
fn neighbors<T, const N: usize>(row: &[T], start: usize) -> [&[T; N]; 3] {
    [block(row, start), block(row, start + 1), block(row, start + 2)]
}

/// Excludes pixels that share a plateau with a non-candidate of the row `across`.
#[inline(always)]
fn exclude_across<T: Level>(
    values: &[T],
    across: &[T],
    marks_across: &[bool],
    marks: &mut [bool],
    connectivity: Connectivity,
) {
    in_blocks!(values.len(), exclude_across_in_block(values, across, marks_across, marks, connectivity));
}

#[inline(always)]
fn exclude_across_in_block<T: Level, const N: usize>(
    start: usize,
    values: &[T],
    across: &[T],
    marks_across: &[bool],
    marks: &mut [bool],
    connectivity: Connectivity,
) {
    let values: &[T; N] = block(values, start);
    let across = neighbors::<T, N>(across, start);
    let marks_across = neighbors::<bool, N>(marks_across, start);
    let mut kept: [bool; N] = *block(marks, start);
    for side in if connectivity == Connectivity::Eight { 0..3 } else { 1..2 } {
        for i in 0..N {
            kept[i] &= (across[side][i] != values[i]) | marks_across[side][i];
        }
    }
    *block_mut(marks, start) = kept;
}

/// Excludes pixels that share a plateau with a non-candidate of the same row. Such pairs are rare, so they are searched in blocks and
/// processed one by one.
#[inline(always)]
fn exclude_along<T: Level>(values: &[T], marks: &mut [bool], differ: &mut [bool]) {
    let n = values.len();
    if n < 2 {
        return;
    }
    let differ = &mut differ[..n - 1];
    in_blocks!(n - 1, differ_in_block(values, marks, differ));
    for (block_idx, pixels) in differ.chunks(BLOCK).enumerate() {
        if !pixels.iter().fold(false, |any, &differ| any | differ) {
            continue;
        }
        for (i, _) in pixels.iter().enumerate().filter(|(_, differ)| **differ) {
            let left = block_idx * BLOCK + i;
            let level = values[left];
            let is_lost = |(mark, value): &(&mut bool, &T)| **mark && **value == level;
            // One of the two sides has candidates, unless an earlier pair excluded them.
            marks[..=left]
                .iter_mut()
                .zip(&values[..=left])
                .rev()
                .take_while(is_lost)
                .for_each(|(mark, _)| *mark = false);
            let after = marks[left + 1..].iter_mut().zip(&values[left + 1..]);
            after.take_while(is_lost).for_each(|(mark, _)| *mark = false);
        }
    }
}

/// Whether a pixel and the next one share a plateau but only one is a candidate.
#[inline(always)]
fn differ_in_block<T: Level, const N: usize>(start: usize, values: &[T], marks: &[bool], into: &mut [bool]) {
    let [left, right]: [&[T; N]; 2] = [block(values, start), block(values, start + 1)];
    let [mark_left, mark_right]: [&[bool; N]; 2] = [block(marks, start), block(marks, start + 1)];
    let differ = |i: usize| (left[i] == right[i]) & (mark_left[i] ^ mark_right[i]);
    *block_mut(into, start) = std::array::from_fn::<bool, N, _>(differ);
}

/// Finds non-candidates of a row with a neighboring candidate of equal value.
#[inline(always)]
fn find_edges<T: Level>(
    image: &Padded<T>,
    candidates: &Padded<bool>,
    row: usize,
    connectivity: Connectivity,
    is_edge: &mut [bool],
    edges: &mut Vec<u32>,
) {
    let values = image.three_rows(row);
    let marks = candidates.three_rows(row);
    in_blocks!(image.cols, find_edges_in_block(values, marks, is_edge, connectivity));
    let start = image.row_start(row);
    for (block_idx, pixels) in is_edge.chunks(BLOCK).enumerate() {
        if pixels.iter().fold(false, |any, &edge| any | edge) {
            let first = start + block_idx * BLOCK;
            edges.extend(pixels.iter().enumerate().filter(|(_, edge)| **edge).map(|(i, _)| (first + i) as u32));
        }
    }
}

#[inline(always)]
fn find_edges_in_block<T: Level, const N: usize>(
    start: usize,
    values: [&[T]; 3],
    marks: [&[bool]; 3],
    into: &mut [bool],
    connectivity: Connectivity,
) {
    let values = values.map(|line| neighbors::<T, N>(line, start));
    let marks = marks.map(|line| neighbors::<bool, N>(line, start));
    let here = values[1][1];
    let mut has_candidate = [false; N];
    let mut look = |row: usize, col: usize| {
        for i in 0..N {
            has_candidate[i] |= marks[row][col][i] & (values[row][col][i] == here[i]);
        }
    };
    for (row, col) in [(0, 1), (1, 0), (1, 2), (2, 1)] {
        look(row, col);
    }
    if connectivity == Connectivity::Eight {
        for (row, col) in [(0, 0), (0, 2), (2, 0), (2, 2)] {
            look(row, col);
        }
    }
    *block_mut(into, start) = std::array::from_fn::<bool, N, _>(|i| has_candidate[i] & !marks[1][1][i]);
}
