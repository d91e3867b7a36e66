//! Regional extrema: plateaus without a higher (lower) neighbor, and those that stand out by a height.

#![allow(
    clippy::needless_bitwise_bool,
    reason = "a branch for each pixel would keep the loops from taking many at once"
)]

use crate::padded::{Padded, shifted};
use crate::wide::wide;
use crate::{Connectivity, Level, reconstruct_by_dilation};
use ndarray::{Array2, Zip};

/// Pixels of plateaus all of whose neighbors are lower. A constant image is one maximum.
pub fn regional_maxima<T: Level>(image: &Array2<T>, connectivity: Connectivity) -> Array2<bool> {
    maxima(&Padded::of(image, T::LOWEST), connectivity)
}

/// Pixels of plateaus all of whose neighbors are higher. A constant image is one minimum.
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

/// Peaks of at least `height` above the highest saddle that leads to a higher peak: the pixels that stand at least `height` above the
/// reconstruction of the image lowered by `height` (Soille 2003, section 6.3.4). Whole numbers must not lie below their
/// type's least value + `height`, or what would be lowered below it shows no peak.
pub fn h_maxima<T: Height>(image: &Array2<T>, height: T, connectivity: Connectivity) -> Array2<bool> {
    let lowered = image.mapv(|value| value.lowered(height));
    let reconstructed = reconstruct_by_dilation(&lowered, image, connectivity);
    Zip::from(image).and(&reconstructed).map_collect(|&value, &base| value > base && value.lowered(height) >= base)
}

fn maxima<T: Level>(image: &Padded<T>, connectivity: Connectivity) -> Array2<bool> {
    // The frame excludes nobody: it is not higher, and a candidate.
    let mut candidates = Padded::filled((image.rows, image.cols), true);
    wide(|| {
        exclude_lower(image, &mut candidates, connectivity);
        sweep_plateaus(image, &mut candidates, connectivity);
    });
    let mut stack: Vec<u32> = Vec::new();
    wide(|| find_edges_of_plateaus(image, &candidates, connectivity, &mut stack));
    // From here on, nothing goes into it.
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

/// Candidates are the pixels without a higher neighbor.
#[inline(always)]
fn exclude_lower<T: Level>(image: &Padded<T>, candidates: &mut Padded<bool>, connectivity: Connectivity) {
    let n = image.cols;
    for row in 0..image.rows {
        let [up, at, down] = image.three_rows(row).map(|line| shifted(line, n));
        let into = &mut candidates.row_mut(row)[..n];
        for i in 0..n {
            let mut highest = up[1][i].sup(down[1][i]).sup(at[0][i]).sup(at[2][i]);
            if connectivity == Connectivity::Eight {
                highest = highest.sup(up[0][i]).sup(up[2][i]).sup(down[0][i]).sup(down[2][i]);
            }
            into[i] = highest <= at[1][i];
        }
    }
}

/// What is no candidate takes the rest of its plateau with it: down and up once, which settles most of them.
#[inline(always)]
fn sweep_plateaus<T: Level>(image: &Padded<T>, candidates: &mut Padded<bool>, connectivity: Connectivity) {
    let (n, stride) = (image.cols, image.stride);
    for is_down in [true, false] {
        for i in 0..image.rows {
            let row = if is_down { i } else { image.rows - 1 - i };
            let [up, at, down] = image.three_rows(row);
            let values = shifted(if is_down { up } else { down }, n);
            let (first, second) = candidates.pixels.split_at_mut((row + 1 + usize::from(!is_down)) * stride);
            let (across, line) = if is_down {
                (&first[row * stride..], &mut second[1..=n])
            } else {
                (&second[..stride], &mut first[(row + 1) * stride..][1..=n])
            };
            let marks = shifted(across, n);
            for (i, (mark, &here)) in line.iter_mut().zip(&at[1..=n]).enumerate() {
                let lost = |c: usize| (values[c][i] == here) & !marks[c][i];
                let mut any = lost(1);
                if connectivity == Connectivity::Eight {
                    any |= lost(0) | lost(2);
                }
                *mark &= !any;
            }
            let mut before = (T::LOWEST, true);
            let mut step = |(mark, &here): (&mut bool, &T)| {
                *mark &= before.1 | (here != before.0);
                before = (here, *mark);
            };
            let both = line.iter_mut().zip(&at[1..=n]);
            if is_down { both.for_each(&mut step) } else { both.rev().for_each(&mut step) }
        }
    }
}

/// Pixels that are no candidates and have a candidate of their own value beside them.
#[inline(always)]
fn find_edges_of_plateaus<T: Level>(
    image: &Padded<T>,
    candidates: &Padded<bool>,
    connectivity: Connectivity,
    stack: &mut Vec<u32>,
) {
    let n = image.cols;
    let mut is_edge = vec![false; n];
    for row in 0..image.rows {
        let values = image.three_rows(row).map(|line| shifted(line, n));
        let marks = candidates.three_rows(row).map(|line| shifted(line, n));
        let mut any = false;
        for i in 0..n {
            let here = values[1][1][i];
            let same = |r: usize, c: usize| marks[r][c][i] & (values[r][c][i] == here);
            let mut beside = same(0, 1) | same(1, 0) | same(1, 2) | same(2, 1);
            if connectivity == Connectivity::Eight {
                beside |= same(0, 0) | same(0, 2) | same(2, 0) | same(2, 2);
            }
            is_edge[i] = beside & !marks[1][1][i];
            any |= is_edge[i];
        }
        if any {
            let start = image.row_start(row);
            stack.extend(is_edge.iter().enumerate().filter(|(_, edge)| **edge).map(|(i, _)| (start + i) as u32));
        }
    }
}
