//! Area opening and closing: peaks and pits of fewer than `area` pixels are removed, everything else keeps its exact shape.

use crate::components::runs_of;
use crate::level::Level;
use crate::neighbors::Connectivity;
use crate::order::sorted_by;
use crate::padded::Padded;
use ndarray::Array2;

/// For each pixel, the highest level at which it belongs to a component of `{image >= level}` with at least `area` pixels, or the
/// minimum of the image if the whole image has fewer. On a binary image, components of fewer than `area` pixels are removed.
pub fn area_opening<T: Level>(image: &Array2<T>, area: usize, connectivity: Connectivity) -> Array2<T> {
    match two_levels(image) {
        Some(levels) => open_binary(image, levels, area, connectivity),
        None => remove_peaks(image, area, connectivity, |value| value),
    }
}

/// The dual of [`area_opening`]. On a binary image, holes of fewer than `area` pixels are filled. `connectivity`
/// applies to the holes: components with eight neighbors have holes with four.
pub fn area_closing<T: Level>(image: &Array2<T>, area: usize, connectivity: Connectivity) -> Array2<T> {
    match two_levels(image) {
        Some([low, high]) => open_binary(image, [high, low], area, connectivity),
        None => remove_peaks(image, area, connectivity, T::complement),
    }
}

/// The two values of the image, if it has at most two.
fn two_levels<T: Level>(image: &Array2<T>) -> Option<[T; 2]> {
    let first = *image.first()?;
    let second = image.iter().copied().find(|&value| value != first).unwrap_or(first);
    let only_those = image.iter().all(|&value| value == first || value == second);
    only_those.then(|| if first < second { [first, second] } else { [second, first] })
}

/// Replaces small components of `peak` by `base`.
fn open_binary<T: Level>(
    image: &Array2<T>,
    [base, peak]: [T; 2],
    area: usize,
    connectivity: Connectivity,
) -> Array2<T> {
    let mut result = image.as_standard_layout().into_owned();
    if base == peak {
        return result;
    }
    let runs = runs_of(&image.mapv(|value| value == peak), connectivity);
    let mut areas = vec![0; runs.n_labels + 1];
    for (label, [start, end]) in runs.labels.iter().zip(&runs.ends) {
        areas[*label as usize] += (end - start) as usize;
    }
    for (row, mut line) in result.rows_mut().into_iter().enumerate() {
        for run_idx in runs.row_range(row).filter(|&run_idx| areas[runs.labels[run_idx] as usize] < area) {
            let [start, end] = runs.ends[run_idx].map(|col| col as usize);
            line.slice_mut(ndarray::s![start..end]).fill(base);
        }
    }
    result
}

/// Floods from the peaks. Components grow until they have `area` pixels (union-find algorithm of Meijster and Wilkinson 2002). `sense`
/// is the identity for peaks, the complement for pits.
fn remove_peaks<T: Level>(
    image: &Array2<T>,
    area: usize,
    connectivity: Connectivity,
    sense: impl Fn(T) -> T + Copy,
) -> Array2<T> {
    let mut levels = Padded::mapped(image, T::LOWEST, sense);
    let steps = levels.steps(connectivity);
    let sequence: Vec<u32> = sorted_by(&levels, |rank| !rank).into_iter().map(|entry| entry as u32).collect();
    let mut forest = Forest::new(levels.pixels.len());
    for &pixel in &sequence {
        let pixel = pixel as usize;
        forest.start(pixel);
        let level = levels.pixels[pixel].rank();
        for &step in &steps {
            let Some(peak) = forest.find(pixel.wrapping_add_signed(step)) else { continue };
            if peak == pixel {
                continue;
            }
            if forest.areas[peak] < area || levels.pixels[peak].rank() == level {
                forest.merge(peak, pixel);
            } else {
                // The component of the pixel contains this peak, so it is also large enough.
                forest.areas[pixel] = forest.areas[pixel].max(area);
            }
        }
    }
    for &pixel in sequence.iter().rev() {
        levels.pixels[pixel as usize] = levels.pixels[forest.parents[pixel as usize] as usize];
    }
    levels.unframed(sense)
}

struct Forest {
    parents: Vec<u32>,
    areas: Vec<usize>,
}

impl Forest {
    const NOT_REACHED: u32 = u32::MAX;

    fn new(n: usize) -> Self {
        Self { parents: vec![Self::NOT_REACHED; n], areas: vec![0; n] }
    }
    fn start(&mut self, pixel: usize) {
        self.parents[pixel] = pixel as u32;
        self.areas[pixel] = 1;
    }
    fn merge(&mut self, peak: usize, into: usize) {
        self.parents[peak] = into as u32;
        self.areas[into] += self.areas[peak];
    }
    /// Root of the component, `None` if the pixel was not flooded yet.
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
