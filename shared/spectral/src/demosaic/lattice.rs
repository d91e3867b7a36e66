//! Each band's samples lie on a lattice of their own; between them bands are bilinear.

/// Size of the mosaic and side of its pattern, px. Whole cells.
#[derive(Clone, Debug)]
pub struct Lattice {
    pub width: usize,
    pub height: usize,
    pub pattern: usize,
}

impl Lattice {
    /// All bands at all pixels, band-sequential. Beyond the outermost samples of a band these go on.
    pub fn interpolate_into(&self, samples: &[f32], bands: &mut [f32]) {
        let (width, pattern) = (self.width, self.pattern);
        let (mut above, mut below) = (vec![0.0; width], vec![0.0; width]);
        for (band, plane) in bands.chunks_exact_mut(width * self.height).enumerate() {
            let (ky, kx) = (band / pattern, band % pattern);
            let row_of = |y: usize| &samples[y * width..][..width];
            self.interpolate_row(row_of(ky), kx, &mut above);
            for y in 0..=ky {
                plane[y * width..][..width].copy_from_slice(&above);
            }
            for y in (ky..self.height - pattern).step_by(pattern) {
                self.interpolate_row(row_of(y + pattern), kx, &mut below);
                for step in 1..=pattern {
                    let share = step as f32 / pattern as f32;
                    let out = &mut plane[(y + step) * width..][..width];
                    for ((out, above), below) in out.iter_mut().zip(&above).zip(&below) {
                        *out = above + (below - above) * share;
                    }
                }
                // The last of these rows is a row of samples, and `above + (below - above)` may be a bit off.
                plane[(y + pattern) * width..][..width].copy_from_slice(&below);
                std::mem::swap(&mut above, &mut below);
            }
            for y in self.height - pattern + ky + 1..self.height {
                plane[y * width..][..width].copy_from_slice(&above);
            }
        }
    }

    /// A row of samples of the bands `kx`, `kx + P`, …: the one in column `kx` of each cell at all columns.
    fn interpolate_row(&self, samples: &[f32], kx: usize, out: &mut [f32]) {
        let pattern = self.pattern;
        let last = self.width - pattern + kx;
        out[..kx].fill(samples[kx]);
        out[last..].fill(samples[last]);
        for (step, share) in (0..pattern).map(|step| (step, step as f32 / pattern as f32)) {
            let lefts = samples[kx..last].iter().step_by(pattern);
            let rights = samples[kx + pattern..].iter().step_by(pattern);
            let outs = out[kx..last].iter_mut().skip(step).step_by(pattern);
            outs.zip(lefts.zip(rights)).for_each(|(out, (left, right))| *out = left + (right - left) * share);
        }
    }

    /// Puts the band's own samples where they were measured.
    pub fn keep_measured(&self, samples: &[f32], band: usize, plane: &mut [f32]) {
        let (width, pattern) = (self.width, self.pattern);
        for y in (band / pattern..self.height).step_by(pattern) {
            let columns = y * width + band % pattern..(y + 1) * width;
            let measured = samples[columns.clone()].iter().step_by(pattern);
            plane[columns].iter_mut().step_by(pattern).zip(measured).for_each(|(out, sample)| *out = *sample);
        }
    }

    /// The mosaic with `margin` more pixels on each side, which go on with the pattern of the outermost cells.
    pub fn padded(&self, samples: &[f32], margin: usize) -> Vec<f32> {
        let columns = self.folded(self.width, margin);
        let mut padded = Vec::with_capacity((self.width + 2 * margin) * (self.height + 2 * margin));
        for y in self.folded(self.height, margin) {
            let row = &samples[y * self.width..][..self.width];
            padded.extend(columns[..margin].iter().map(|x| row[*x]));
            padded.extend_from_slice(row);
            padded.extend(columns[margin + self.width..].iter().map(|x| row[*x]));
        }
        padded
    }

    /// For the positions from `-margin` to `length + margin`: the position inside with the same place in its cell.
    pub fn folded(&self, length: usize, margin: usize) -> Vec<usize> {
        let pattern = self.pattern as isize;
        let fold = |at: isize| match at {
            at if at < 0 => at.rem_euclid(pattern),
            at if at >= length as isize => length as isize - pattern + at.rem_euclid(pattern),
            at => at,
        };
        (-(margin as isize)..(length + margin) as isize).map(|at| fold(at) as usize).collect()
    }
}
