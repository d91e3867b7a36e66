//! Lengths of ways that stay inside: steps of 1 along rows and columns, of the square root of 2 across corners.

use crate::padded::Padded;
use crate::{Connectivity, Labels};
use ndarray::Array2;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Length of the shortest way from any seed (row, column) to each pixel, pixels; infinite where no way leads inside `mask`.
pub fn geodesic_distances(mask: &Array2<bool>, seeds: &[(usize, usize)]) -> Array2<f64> {
    let inside = Padded::of(mask, false);
    let mut walk = Walk::new(&inside);
    let seeds = seeds.iter().map(|&(row, col)| inside.row_start(row) + col).filter(|&pixel| inside.pixels[pixel]);
    walk.go(&inside, true, &seeds.collect::<Vec<_>>());
    walk.distances.unframed(|distance| distance)
}

/// Geodesic elongation of each component, `pi L^2 / (4 A)` with its length L and area A (Lantuejoul and Maisonneuve 1984): 1 to 1.3 for a
/// disc (ways aslant are up to 8 % longer than the crow flies), the ratio of length to width times pi / 4 for a bar, bent or not. In the order of the labels.
///
/// L is the length from the pixel farthest from the component's first to the one farthest from that, and a pixel's own width:
/// exact where the component has no holes and is not much curved, else never too long.
pub fn geodesic_elongations(labels: &Labels) -> Vec<f64> {
    let image = Padded::of(&labels.image, 0);
    let mut walk = Walk::new(&image);
    let mut elongations = vec![0.0; labels.n()];
    let mut n_found = 0;
    for row in 0..image.rows {
        let start = image.row_start(row);
        for pixel in start..start + image.cols {
            // Labels count up in raster order: the next one is met at its first pixel.
            if image.pixels[pixel] as usize != n_found + 1 {
                continue;
            }
            let label = image.pixels[pixel];
            let (one_end, _) = walk.go(&image, label, &[pixel]);
            walk.forget();
            let (_, length) = walk.go(&image, label, &[one_end]);
            walk.forget();
            let length = length + 1.0;
            elongations[n_found] = std::f64::consts::PI * length * length / (4.0 * labels.areas[n_found] as f64);
            n_found += 1;
        }
    }
    elongations
}

/// Dijkstra's algorithm over pixels of one value.
struct Walk {
    distances: Padded<f64>,
    /// Pixels with a distance.
    reached: Vec<u32>,
    steps: Vec<(isize, f64)>,
}

impl Walk {
    fn new<T: Copy>(image: &Padded<T>) -> Self {
        let length = |&step: &isize| {
            let straight = [1, image.stride].contains(&step.unsigned_abs());
            (step, if straight { 1.0 } else { std::f64::consts::SQRT_2 })
        };
        Self {
            distances: Padded::filled((image.rows, image.cols), f64::INFINITY),
            reached: Vec::new(),
            steps: image.steps(Connectivity::Eight).iter().map(length).collect(),
        }
    }

    /// Walks over all pixels of that value from the seeds. The last pixel reached, and its distance.
    fn go<T: Copy + PartialEq>(&mut self, image: &Padded<T>, value: T, seeds: &[usize]) -> (usize, f64) {
        // Distances are not negative, so their bits are in their order.
        let mut heap: BinaryHeap<Reverse<(u64, u32)>> = BinaryHeap::new();
        for &seed in seeds {
            self.distances.pixels[seed] = 0.0;
            self.reached.push(seed as u32);
            heap.push(Reverse((0, seed as u32)));
        }
        let mut last = (seeds.first().copied().unwrap_or_default(), 0.0);
        while let Some(Reverse((bits, pixel))) = heap.pop() {
            let (pixel, distance) = (pixel as usize, f64::from_bits(bits));
            if distance > self.distances.pixels[pixel] {
                continue;
            }
            if distance > last.1 {
                last = (pixel, distance);
            }
            for &(step, length) in &self.steps {
                let neighbor = pixel.wrapping_add_signed(step);
                let there = distance + length;
                let known = self.distances.pixels[neighbor];
                if image.pixels[neighbor] == value && there < known {
                    if known == f64::INFINITY {
                        self.reached.push(neighbor as u32);
                    }
                    self.distances.pixels[neighbor] = there;
                    heap.push(Reverse((there.to_bits(), neighbor as u32)));
                }
            }
        }
        last
    }

    fn forget(&mut self) {
        for pixel in self.reached.drain(..) {
            self.distances.pixels[pixel as usize] = f64::INFINITY;
        }
    }
}
