//! Projection of pixels onto color lines.

use crate::image::{Image, Pixels};
use crate::{ColorLinesError, Model};

/// An image projected onto lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Projection {
    /// The spectrum of the nearest point on the lines, band-sequential. NaN where a pixel is invalid.
    pub values: Vec<f32>,
    /// Number of the line of each pixel, from 1; 0 if the pixel is invalid.
    pub lines: Vec<u32>,
}

impl Projection {
    /// A projection with only invalid pixels.
    pub(crate) fn empty(image: &Image<'_>) -> Self {
        Self { values: vec![f32::NAN; image.n_pixels() * image.n_bands()], lines: vec![0; image.n_pixels()] }
    }
}

/// A segment of a line: its start, its direction to the end, and the squared length.
struct Segment {
    line: u32,
    begin: Vec<f32>,
    direction: Vec<f32>,
    square: f32,
}

/// Pixels per block: their bands and distances fit into the first-level cache.
const BLOCK: usize = 256;

impl Model {
    /// Replaces each pixel by the nearest point on the `n_lines` longest lines (thesis, section 3.4.2): the means of a
    /// line are joined by straight segments.
    pub fn projected(&self, image: &Image<'_>, n_lines: usize) -> Result<Projection, ColorLinesError> {
        self.check_bands(image)?;
        let segments = self.segments(n_lines)?;
        Ok(project(image, &segments))
    }

    fn segments(&self, n_lines: usize) -> Result<Vec<Segment>, ColorLinesError> {
        if self.lines.is_empty() {
            return Err(ColorLinesError::Model("has no lines: it was made with a spatial weight"));
        }
        let origin = vec![0.0; self.n_bands()];
        let node = |node: &usize| node.checked_sub(1).map_or(&origin, |region| &self.regions[region].spectrum);
        let mut segments = Vec::new();
        for (number, line) in (1..).zip(self.lines.iter().take(n_lines)) {
            // A line of one node is a point.
            if let [single] = line.nodes.as_slice() {
                segments.push(Segment::new(number, node(single), node(single)));
            }
            segments.extend(line.nodes.windows(2).map(|pair| Segment::new(number, node(&pair[0]), node(&pair[1]))));
        }
        Ok(segments)
    }
}

impl Segment {
    fn new(line: u32, begin: &[f64], end: &[f64]) -> Self {
        let direction: Vec<f32> = begin.iter().zip(end).map(|(begin, end)| (end - begin) as f32).collect();
        let square = direction.iter().map(|value| value * value).sum();
        Self { line, begin: begin.iter().map(|value| *value as f32).collect(), direction, square }
    }
}

/// The nearest point of all segments for every pixel.
fn project(image: &Image<'_>, segments: &[Segment]) -> Projection {
    let pixels = image.pixels();
    let mut projection = Projection::empty(image);
    for start in (0..pixels.len()).step_by(BLOCK) {
        let n = BLOCK.min(pixels.len() - start);
        let mut best = Best { square: [f32::INFINITY; BLOCK], segment: [0; BLOCK], share: [0.0; BLOCK] };
        for (index, segment) in (0..).zip(segments) {
            wide_loops::run(
                #[inline(always)]
                || best.compare(&pixels, start..start + n, index, segment),
            );
        }
        for i in 0..n {
            let at = pixels.at[start + i] as usize;
            let segment = &segments[best.segment[i] as usize];
            projection.lines[at] = segment.line;
            for band in 0..image.n_bands() {
                projection.values[band * image.n_pixels() + at] =
                    segment.begin[band] + best.share[i] * segment.direction[band];
            }
        }
    }
    projection
}

/// The nearest segment of each pixel of a block so far.
struct Best {
    square: [f32; BLOCK],
    segment: [u32; BLOCK],
    /// Position on the segment, 0 at the start, 1 at the end.
    share: [f32; BLOCK],
}

impl Best {
    #[inline(always)]
    fn compare(&mut self, pixels: &Pixels, range: std::ops::Range<usize>, index: u32, segment: &Segment) {
        // Square of the difference to the start, and its product with the direction.
        let mut squares = [0.0_f32; BLOCK];
        let mut products = [0.0_f32; BLOCK];
        for (band, values) in pixels.bands.iter().enumerate() {
            let begin = segment.begin[band];
            let direction = segment.direction[band];
            let sums = squares.iter_mut().zip(&mut products);
            for ((square, product), value) in sums.zip(&values[range.clone()]) {
                let difference = value - begin;
                *square += difference * difference;
                *product += difference * direction;
            }
        }
        let per_square = if segment.square > 0.0 { 1.0 / segment.square } else { 0.0 };
        for i in 0..BLOCK {
            let along = products[i] * per_square;
            let share = along.clamp(0.0, 1.0);
            let square = squares[i] + share * (share * segment.square - 2.0 * products[i]);
            let is_nearer = square < self.square[i];
            self.square[i] = if is_nearer { square } else { self.square[i] };
            self.segment[i] = if is_nearer { index } else { self.segment[i] };
            self.share[i] = if is_nearer { share } else { self.share[i] };
        }
    }
}
