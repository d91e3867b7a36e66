//! The sharp pseudo-panchromatic image of PPID (Mihoubi et al., IEEE TCI 2017, section III).

use super::lattice::Lattice;

/// Added to every difference along a direction, so that weights stay finite: 1/255, as in the paper.
const FLAT: f32 = 1.0 / 255.0;

/// A position relative to the pixel, and its weight in the dissimilarity of a direction.
type Term = ([isize; 2], f32);

/// Unit step (x, y) to the next sample of the same band, and the positions where the two neighborhoods are compared.
fn directions() -> [([isize; 2], Vec<Term>); 8] {
    [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]].map(|[dx, dy]| {
        let terms = if dx == 0 || dy == 0 {
            // The pixel, the next one in the direction, and the neighbors of both across: (2 - i)(2 - |j|).
            let weights = [(0, -1, 2.0), (0, 0, 4.0), (0, 1, 2.0), (1, -1, 1.0), (1, 0, 2.0), (1, 1, 1.0)];
            weights.map(|(i, j, weight)| ([i * dx - j * dy, i * dy + j * dx], weight)).to_vec()
        } else {
            // The square between the pixel and the next one in the direction.
            vec![([0, 0], 4.0), ([dx, 0], 2.0), ([0, dy], 2.0), ([dx, dy], 4.0)]
        };
        ([dx, dy], terms)
    })
}

/// The PPI at each pixel: its sample, and the mean of `difference` (the blurred PPI minus the sample) at the eight nearest samples of
/// its band, weighted by the similarity of the two neighborhoods.
pub fn sharpen(lattice: &Lattice, samples: &[f32], difference: &[f32], ppi: &mut [f32]) {
    let width = lattice.width;
    let pattern = lattice.pattern as isize;
    // The terms extend one pixel beyond the next sample.
    let margin = lattice.pattern + 1;
    let stride = (width + 2 * margin) as isize;
    let [samples_padded, difference_padded] = [samples, difference].map(|image| lattice.padded(image, margin));
    let directions = directions();
    let mut dissimilarity = vec![0.0; width];
    let mut sum = vec![0.0; width];
    let mut weights = vec![0.0; width];
    let rows = samples.chunks_exact(width).zip(ppi.chunks_exact_mut(width));
    for (y, (samples, ppi)) in rows.enumerate() {
        let start = (y + margin) as isize * stride + margin as isize;
        // The shifted row, inside the margin.
        let shifted = |[dx, dy]: [isize; 2]| {
            let from = (start + dy * stride + dx) as usize;
            from..from + width
        };
        sum.fill(0.0);
        weights.fill(0.0);
        for ([dx, dy], terms) in &directions {
            let [far_x, far_y] = [dx * pattern, dy * pattern];
            wide_loops::run(
                #[inline(always)]
                || {
                    dissimilarity.fill(FLAT);
                    for ([x, y], weight) in terms {
                        let here = &samples_padded[shifted([*x, *y])];
                        let there = &samples_padded[shifted([x + far_x, y + far_y])];
                        add_dissimilarity(here, there, *weight, &mut dissimilarity);
                    }
                    weigh(&dissimilarity, &difference_padded[shifted([far_x, far_y])], &mut sum, &mut weights);
                },
            );
        }
        for (((ppi, sample), sum), weights) in ppi.iter_mut().zip(samples).zip(&sum).zip(&weights) {
            *ppi = sample + sum / weights;
        }
    }
}

#[inline(always)]
fn add_dissimilarity(here: &[f32], there: &[f32], weight: f32, dissimilarity: &mut [f32]) {
    for ((dissimilarity, here), there) in dissimilarity.iter_mut().zip(here).zip(there) {
        *dissimilarity += weight * (here - there).abs();
    }
}

#[inline(always)]
fn weigh(dissimilarity: &[f32], there: &[f32], sum: &mut [f32], weights: &mut [f32]) {
    for (((sum, weights), dissimilarity), there) in sum.iter_mut().zip(weights).zip(dissimilarity).zip(there) {
        let weight = 1.0 / dissimilarity;
        *sum += weight * there;
        *weights += weight;
    }
}
