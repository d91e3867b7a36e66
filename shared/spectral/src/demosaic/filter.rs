//! Filters over a mosaic that give each band of a cell the same weight.

use super::lattice::Lattice;

/// Box filter of the size of the pattern. An even pattern has no center pixel: the outermost samples have half the
/// weight.
pub fn box_into(lattice: &Lattice, samples: &[f32], out: &mut Vec<f32>, scratch: &mut Vec<f32>) {
    let pattern = lattice.pattern;
    let n_taps = pattern + 1 - pattern % 2;
    let mut kernel = vec![1.0 / pattern as f32; n_taps];
    if pattern.is_multiple_of(2) {
        kernel[0] *= 0.5;
        kernel[n_taps - 1] *= 0.5;
    }
    separable_into(lattice, samples, &kernel, out, scratch);
}

/// Tent filter: the sum of the bilinear interpolations of all bands.
pub fn tent_into(lattice: &Lattice, samples: &[f32], out: &mut Vec<f32>, scratch: &mut Vec<f32>) {
    let pattern = lattice.pattern;
    let kernel: Vec<f32> = (1..2 * pattern).map(|tap| tap.min(2 * pattern - tap) as f32 / pattern as f32).collect();
    separable_into(lattice, samples, &kernel, out, scratch);
}

/// Convolution with the same symmetric kernel of odd length along rows and columns.
fn separable_into(lattice: &Lattice, samples: &[f32], kernel: &[f32], out: &mut Vec<f32>, scratch: &mut Vec<f32>) {
    let width = lattice.width;
    let margin = kernel.len() / 2;
    let columns = lattice.folded(width, margin);
    let mut padded = vec![0.0; width + 2 * margin];
    scratch.clear();
    scratch.resize(samples.len(), 0.0);
    for (row, blurred) in samples.chunks_exact(width).zip(scratch.chunks_exact_mut(width)) {
        padded.iter_mut().zip(&columns).for_each(|(value, x)| *value = row[*x]);
        for (tap, weight) in kernel.iter().enumerate() {
            wide_loops::run(
                #[inline(always)]
                || add_weighted(&padded[tap..], *weight, blurred),
            );
        }
    }
    out.clear();
    out.resize(samples.len(), 0.0);
    let rows = lattice.folded(lattice.height, margin);
    for (y, sums) in out.chunks_exact_mut(width).enumerate() {
        for (row, weight) in rows[y..].iter().zip(kernel) {
            let values = &scratch[row * width..][..width];
            wide_loops::run(
                #[inline(always)]
                || add_weighted(values, *weight, sums),
            );
        }
    }
}

#[inline(always)]
fn add_weighted(values: &[f32], weight: f32, sums: &mut [f32]) {
    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
}
