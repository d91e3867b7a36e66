//! The lattice of the samples of each band, between which bands are interpolated bilinearly.

/// Size of the mosaic and side of its pattern, px; complete cells only.
#[derive(Clone, Debug)]
pub struct Lattice {
    pub width: usize,
    pub height: usize,
    pub pattern: usize,
}

/// Rows of samples before and after a row.
#[derive(Clone, Copy)]
pub struct SamplesBetween {
    /// The row at or before the position.
    pub before: usize,
    /// The next row.
    pub after: usize,
    /// Distance from the row before, in pixels.
    pub step: usize,
}

impl Lattice {
    /// Number of bands.
    pub fn n_bands(&self) -> usize {
        self.pattern * self.pattern
    }

    /// The mosaic with `margin` more pixels on each side, which continue the pattern of the outermost cells.
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

    /// For the positions from `-margin` to `length + margin`: the position inside with the same offset in its cell.
    pub fn folded(&self, length: usize, margin: usize) -> Vec<usize> {
        let pattern = self.pattern as isize;
        let fold = |at: isize| match at {
            at if at < 0 => at.rem_euclid(pattern),
            at if at >= length as isize => length as isize - pattern + at.rem_euclid(pattern),
            at => at,
        };
        (-(margin as isize)..(length + margin) as isize).map(|at| fold(at) as usize).collect()
    }

    /// The rows of samples around row `y` of the bands in row `ky` of the pattern. Beyond the outermost rows, these rows
    /// are used.
    pub fn between(&self, y: usize, ky: usize) -> SamplesBetween {
        if y < ky {
            return SamplesBetween { before: ky, after: ky, step: 0 };
        }
        let step = (y - ky) % self.pattern;
        let before = y - step;
        if before + self.pattern < self.height {
            SamplesBetween { before, after: before + self.pattern, step }
        } else {
            SamplesBetween { before, after: before, step: 0 }
        }
    }
}
