//! Invalid samples: their replacement, and the bands that they invalidate.

use super::lattice::{Lattice, SamplesBetween};

/// Replaces every sample that is not `valid` by the mean of the nearest samples of its band: left and above after their
/// own replacement, right and below if they are valid; 0 if there are no such samples. Filters then do not treat it as
/// black.
pub fn bridge(lattice: &Lattice, samples: &mut [f32], valid: &[bool]) {
    let Lattice { width, height, pattern } = *lattice;
    for at in (0..samples.len()).filter(|at| !valid[*at]) {
        let x = at % width;
        let y = at / width;
        let before = [(x >= pattern).then(|| at - pattern), (y >= pattern).then(|| at - pattern * width)];
        let after =
            [(x + pattern < width).then_some(at + pattern), (y + pattern < height).then_some(at + pattern * width)];
        let after = after.map(|near| near.filter(|near| valid[*near]));
        let near = || before.into_iter().chain(after).flatten();
        let sum: f32 = near().map(|near| samples[near]).sum();
        samples[at] = sum / near().count().max(1) as f32;
    }
}

/// Validity of the bands: bit k of a pixel's mask is 1 if all samples used to interpolate band k there are `valid`.
/// `masks` is overwritten.
pub fn masks_into(lattice: &Lattice, valid: &[bool], masks: &mut [u32]) {
    let Lattice { width, height, pattern } = *lattice;
    // Validity along each row of samples, at the bits of the first pattern row.
    let mut along = vec![0_u32; width * height];
    for (valid, bits) in valid.chunks_exact(width).zip(along.chunks_exact_mut(width)) {
        for kx in 0..pattern {
            // Interpolation along columns equals interpolation along rows of the transposed image.
            let columns = Lattice { width: height, height: width, pattern };
            for (x, bits) in bits.iter_mut().enumerate() {
                let SamplesBetween { before: left, after: right, .. } = columns.between(x, kx);
                let needs_right = x > left;
                *bits |= u32::from(valid[left] && (valid[right] || !needs_right)) << kx;
            }
        }
    }
    for (y, masks) in masks.chunks_exact_mut(width).enumerate() {
        masks.fill(0);
        for ky in 0..pattern {
            let SamplesBetween { before: above, after: below, step } = lattice.between(y, ky);
            let below = if step == 0 { above } else { below };
            let rows = along[above * width..][..width].iter().zip(&along[below * width..][..width]);
            masks.iter_mut().zip(rows).for_each(|(mask, (above, below))| *mask |= (above & below) << (ky * pattern));
        }
    }
}
