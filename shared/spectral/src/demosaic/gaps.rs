//! Samples that say nothing: which bands they leave unknown, and what stands in for them.

use super::lattice::Lattice;

/// Puts in the place of every sample that is not `valid` the mean of the nearest ones of its band: left and above as they stand
/// after this, right and below if they are valid; 0 if there are none. The blurs around it then do not take it for black.
pub fn bridge(lattice: &Lattice, samples: &mut [f32], valid: &[bool]) {
    let Lattice { width, height, pattern } = *lattice;
    for at in (0..samples.len()).filter(|at| !valid[*at]) {
        let (x, y) = (at % width, at / width);
        let known_so_far = [(x >= pattern).then(|| at - pattern), (y >= pattern).then(|| at - pattern * width)];
        let to_come =
            [(x + pattern < width).then_some(at + pattern), (y + pattern < height).then_some(at + pattern * width)];
        let to_come = to_come.map(|near| near.filter(|near| valid[*near]));
        let near = || known_so_far.into_iter().chain(to_come).flatten();
        let sum: f32 = near().map(|near| samples[near]).sum();
        samples[at] = sum / near().count().max(1) as f32;
    }
}

/// Which bands are known where: bit k of a pixel's mask says that all samples between which band k is interpolated there are
/// `valid`. `masks` is overwritten.
pub fn masks_into(lattice: &Lattice, valid: &[bool], masks: &mut [u32]) {
    let Lattice { width, height, pattern } = *lattice;
    // Along the row of samples itself, at the bits that the bands of a first pattern row have.
    let mut along = vec![0_u32; width * height];
    for (valid, bits) in valid.chunks_exact(width).zip(along.chunks_exact_mut(width)) {
        for kx in 0..pattern {
            // As between the rows of an image, on its side.
            let columns = Lattice { width: height, height: width, pattern };
            for (x, bits) in bits.iter_mut().enumerate() {
                let (left, right, _) = columns.between(x, kx);
                let needs_right = x > left;
                *bits |= u32::from(valid[left] && (valid[right] || !needs_right)) << kx;
            }
        }
    }
    for (y, masks) in masks.chunks_exact_mut(width).enumerate() {
        masks.fill(0);
        for ky in 0..pattern {
            let (above, below, step) = lattice.between(y, ky);
            let below = if step == 0 { above } else { below };
            let rows = along[above * width..][..width].iter().zip(&along[below * width..][..width]);
            masks.iter_mut().zip(rows).for_each(|(mask, (above, below))| *mask |= (above & below) << (ky * pattern));
        }
    }
}
