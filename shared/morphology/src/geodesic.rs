//! Geodesic distances: path lengths inside a mask, with steps of 1 along rows and columns and of sqrt(2) along diagonals.

use crate::labels::Labels;
use crate::neighbors::Connectivity;
use crate::padded::Padded;
use ndarray::Array2;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Length of the shortest path inside `mask` from any seed (row, column) to each pixel, pixels. Infinite without a path.
pub fn geodesic_distances(mask: &Array2<bool>, seeds: &[(usize, usize)]) -> Array2<f64> {
    let inside = Padded::new(mask, false);
    let mut walk = Walk::new(&inside);
    let seeds = seeds.iter().map(|&(row, col)| inside.row_start(row) + col).filter(|&pixel| inside.pixels[pixel]);
    walk.go(&inside, true, &seeds.collect::<Vec<_>>());
    walk.distances.unframed(|distance| distance)
}

/// Geodesic elongation of each component in the order of the labels: `pi L^2 / (4 A)` with length L and area A (Lantuejoul and
/// Maisonneuve 1984). It is 1 to 1.3 for a disc (oblique paths are up to 8 % too long), and pi / 4 times the ratio of length to width
/// for a bar, straight or bent.
///
/// L is the distance between two ends plus one pixel. The first end is the pixel farthest from the first pixel of the component, the
/// second is the pixel farthest from the first end. L is exact for components without holes and strong curvature, and never too
/// large.
pub fn geodesic_elongations(labels: &Labels) -> Vec<f64> {
    let image = Padded::new(&labels.image, 0);
    let mut walk = Walk::new(&image);
    let mut elongations = vec![0.0; labels.n()];
    let mut n_found = 0;
    for row in 0..image.rows {
        let start = image.row_start(row);
        for pixel in start..start + image.cols {
            // Labels increase in raster order, so the next label is found at its first pixel.
            if image.pixels[pixel] as usize != n_found + 1 {
                continue;
            }
            let label = image.pixels[pixel];
            let (one_end, _) = walk.go(&image, label, &[pixel]);
            walk.reset();
            let (_, length) = walk.go(&image, label, &[one_end]);
            walk.reset();
            let length = length + 1.0;
            elongations[n_found] = std::f64::consts::PI * length * length / (4.0 * labels.areas[n_found] as f64);
            n_found += 1;
        }
    }
    elongations
}

/// Dijkstra's algorithm on pixels of one value.
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

    /// Computes distances of all connected pixels of a value from the seeds. Returns the farthest pixel and its distance.
    fn go<T: Copy + PartialEq>(&mut self, image: &Padded<T>, value: T, seeds: &[usize]) -> (usize, f64) {
        // Distances are not negative, so their bit patterns have the same order.
        let mut heap: BinaryHeap<Reverse<(u64, u32)>> = BinaryHeap::new();
        for &seed in seeds {
            self.distances.pixels[seed] = 0.0;
            self.reached.push(seed as u32);
            heap.push(Reverse((0, seed as u32)));
        }
        let mut last = (seeds.first().copied().unwrap_or_default(), 0.0);
        while let Some(Reverse((bits, pixel))) = heap.pop() {
            let pixel = pixel as usize;
            let distance = f64::from_bits(bits);
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

    fn reset(&mut self) {
        for pixel in self.reached.drain(..) {
            self.distances.pixels[pixel as usize] = f64::INFINITY;
        }
    }
}
