//! All bands at full resolution, row by row: the input stays in the cache, and no cube is stored.

use super::lattice::Lattice;
use crate::limits::MAX_PATTERN;
use crate::planes::Planes;

/// Parts of an image: a mosaic that is interpolated for each band, and a part that all bands share.
pub struct Parts<'a> {
    pub lattice: &'a Lattice,
    /// A mosaic; its bands are interpolated.
    pub mosaic: &'a [f32],
    /// Image that is added to all bands, if there is one.
    pub shared: Option<&'a [f32]>,
    /// The measured samples, which are kept in the image.
    pub measured: &'a [f32],
}

/// Rows of an image, from top to bottom.
pub struct Rows<'a> {
    parts: Parts<'a>,
    /// Row of samples above the current row at all columns, for each band; `below` holds the row below.
    above: Vec<f32>,
    below: Vec<f32>,
    next: usize,
}

impl<'a> Rows<'a> {
    /// Starts at the top.
    pub fn new(parts: Parts<'a>) -> Self {
        let n = parts.lattice.n_bands() * parts.lattice.width;
        let mut rows = Self { parts, above: vec![0.0; n], below: vec![0.0; n], next: 0 };
        for ky in 0..rows.parts.lattice.pattern {
            // The first row of samples becomes the row above when the image reaches it.
            rows.read(ky, ky);
        }
        rows
    }

    /// Writes the next row of all bands into `planes`.
    pub fn next_into(&mut self, planes: &mut Planes<'_>) {
        let Lattice { width, height, pattern } = *self.parts.lattice;
        let y = self.next;
        self.next += 1;
        // For bands with samples in this row, it becomes the row above, and their next row is read.
        let moved = (y % pattern) * pattern * width..(y % pattern + 1) * pattern * width;
        self.above[moved.clone()].swap_with_slice(&mut self.below[moved]);
        if y + pattern < height {
            self.read(y + pattern, y % pattern);
        }
        let shared = self.parts.shared.map(|image| &image[y * width..][..width]);
        let measured = &self.parts.measured[y * width..][..width];
        for band in 0..pattern * pattern {
            let ky = band / pattern;
            let kx = band % pattern;
            let out = &mut planes.values[band * planes.stride + planes.start..][..width];
            // Before its first samples, a band has only a row below.
            let above = if y < ky { &self.below } else { &self.above };
            let above = &above[band * width..][..width];
            let below = &self.below[band * width..][..width];
            match self.parts.lattice.between(y, ky).step {
                0 => out.copy_from_slice(above),
                step => {
                    let share = step as f32 / pattern as f32;
                    wide_loops::run(
                        #[inline(always)]
                        || between_into(above, below, share, out),
                    );
                }
            }
            if let Some(shared) = shared {
                wide_loops::run(
                    #[inline(always)]
                    || out.iter_mut().zip(shared).for_each(|(value, shared)| *value += shared),
                );
            }
            if ky == y % pattern {
                let samples = measured[kx..].iter().step_by(pattern);
                out[kx..].iter_mut().step_by(pattern).zip(samples).for_each(|(out, sample)| *out = *sample);
            }
        }
    }

    /// Reads row `y` of the samples of the bands in row `ky` of the pattern.
    fn read(&mut self, y: usize, ky: usize) {
        let Lattice { width, pattern, .. } = *self.parts.lattice;
        let samples = &self.parts.mosaic[y * width..][..width];
        for kx in 0..pattern {
            let out = &mut self.below[(ky * pattern + kx) * width..][..width];
            match pattern {
                1 => interpolate_row::<1>(samples, kx, out),
                2 => interpolate_row::<2>(samples, kx, out),
                3 => interpolate_row::<3>(samples, kx, out),
                4 => interpolate_row::<4>(samples, kx, out),
                _ => interpolate_row::<{ MAX_PATTERN as usize }>(samples, kx, out),
            }
        }
    }
}

#[inline(always)]
fn between_into(above: &[f32], below: &[f32], share: f32, out: &mut [f32]) {
    for ((out, above), below) in out.iter_mut().zip(above).zip(below) {
        *out = above + (below - above) * share;
    }
}

/// Interpolates a row of samples of the bands `kx`, `kx + P`, … to all columns; each cell has one sample, in column `kx`.
fn interpolate_row<const P: usize>(samples: &[f32], kx: usize, out: &mut [f32]) {
    let last = samples.len() - P + kx;
    out[..kx].fill(samples[kx]);
    out[last..].fill(samples[last]);
    let shares: [f32; P] = std::array::from_fn(|step| step as f32 / P as f32);
    let lefts = samples[kx..last].as_chunks::<P>().0;
    let rights = samples[kx + P..].iter().step_by(P);
    for ((out, left), right) in out[kx..last].as_chunks_mut::<P>().0.iter_mut().zip(lefts).zip(rights) {
        for (out, share) in out.iter_mut().zip(shares) {
            *out = left[0] + (right - left[0]) * share;
        }
    }
}
