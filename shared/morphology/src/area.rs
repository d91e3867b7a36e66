//! Opening and closing by area: peaks and pits of fewer than `area` pixels are levelled, all else keeps its exact shape.

use crate::neighbors::Raster;
use crate::{Connectivity, Level};
use ndarray::Array2;
use std::cmp::Ordering;

/// The greatest level at which the pixel belongs to a component of `{image >= level}` with at least `area` pixels; the
/// image's least value if the whole image has fewer. On a binary image: components of fewer than `area` pixels go.
pub fn area_opening<T: Level>(image: &Array2<T>, area: usize, connectivity: Connectivity) -> Array2<T> {
    level_extrema(image, area, connectivity, |a, b| b.order(a))
}

/// The dual of [`area_opening`]. On a binary image: holes and bays of fewer than `area` pixels are filled. The
/// connectivity is that of the pits; components with eight neighbors have holes with four.
pub fn area_closing<T: Level>(image: &Array2<T>, area: usize, connectivity: Connectivity) -> Array2<T> {
    level_extrema(image, area, connectivity, T::order)
}

/// Floods from the extrema (first in `order`) and lets a basin grow until it has `area` pixels (Meijster and Wilkinson
/// 2002, the union-find algorithm).
fn level_extrema<T: Level>(
    image: &Array2<T>,
    area: usize,
    connectivity: Connectivity,
    order: impl Fn(T, T) -> Ordering,
) -> Array2<T> {
    let raster = Raster::new(image.dim());
    let mut result = image.as_standard_layout().into_owned();
    let levels = result.as_slice_mut().expect("standard layout was asked for");
    let mut sequence: Vec<u32> = (0..levels.len() as u32).collect();
    sequence.sort_by(|&a, &b| order(levels[a as usize], levels[b as usize]));

    let mut forest = Basins::new(levels.len());
    for pixel in sequence.iter().map(|&pixel| pixel as usize) {
        forest.start(pixel);
        for neighbor in raster.neighbors(pixel, connectivity) {
            let Some(basin) = forest.find(neighbor) else { continue };
            if basin == pixel {
                continue;
            }
            if order(levels[basin], levels[pixel]) == Ordering::Equal || forest.areas[basin] < area {
                forest.merge(basin, pixel);
            } else {
                // The pixel's own component holds that basin too, so it is large enough as well.
                forest.areas[pixel] = forest.areas[pixel].max(area);
            }
        }
    }
    for pixel in sequence.iter().rev().map(|&pixel| pixel as usize) {
        let parent = forest.parents[pixel] as usize;
        levels[pixel] = levels[parent];
    }
    result
}

struct Basins {
    parents: Vec<u32>,
    areas: Vec<usize>,
}

impl Basins {
    const NOT_REACHED: u32 = u32::MAX;

    fn new(n: usize) -> Self {
        Self { parents: vec![Self::NOT_REACHED; n], areas: vec![0; n] }
    }
    fn start(&mut self, pixel: usize) {
        self.parents[pixel] = pixel as u32;
        self.areas[pixel] = 1;
    }
    fn merge(&mut self, basin: usize, into: usize) {
        self.parents[basin] = into as u32;
        self.areas[into] += self.areas[basin];
    }
    /// Root of the basin, `None` if the flood has not come here yet.
    fn find(&mut self, pixel: usize) -> Option<usize> {
        let mut at = pixel;
        if self.parents[at] == Self::NOT_REACHED {
            return None;
        }
        while self.parents[at] as usize != at {
            let grandparent = self.parents[self.parents[at] as usize];
            self.parents[at] = grandparent;
            at = grandparent as usize;
        }
        Some(at)
    }
}
