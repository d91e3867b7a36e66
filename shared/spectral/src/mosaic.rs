//! Geometry of the band filters of a mosaic camera.

use crate::SpectralError;
use crate::limits::MAX_PATTERN;

/// Filter geometry of one camera, in pixels of its raw image (column x to the right, row y down, from the top left).
///
/// Pixel (x, y) of the active area belongs to band `k = ((y - y0) mod P) P + ((x - x0) mod P)` and to the cell in column
/// `(x - x0) / P`, row `(y - y0) / P`. Pixels right of and below the last complete cell belong to no cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mosaic {
    width: u32,
    height: u32,
    pattern: u32,
    x0: u32,
    y0: u32,
    columns: u32,
    rows: u32,
    bit_depth: u32,
}

impl Mosaic {
    /// An image of `size` = width, height with `active_area` = left column, top row, width, height.
    pub fn new(size: [u32; 2], pattern: u32, active_area: [u32; 4], bit_depth: u32) -> Result<Self, SpectralError> {
        if !(1..=MAX_PATTERN).contains(&pattern) {
            return Err(SpectralError::Pattern(pattern));
        }
        if !(1..=16).contains(&bit_depth) {
            return Err(SpectralError::BitDepth(bit_depth));
        }
        let [image_width, image_height] = size;
        let [x, y, width, height] = active_area;
        let ends_inside =
            |start: u32, length: u32, limit: u32| start.checked_add(length).is_some_and(|end| end <= limit);
        let inside = ends_inside(x, width, image_width) && ends_inside(y, height, image_height);
        if !inside || width < pattern || height < pattern {
            return Err(SpectralError::ActiveArea { x, y, width, height, image_width, image_height, pattern });
        }
        Ok(Self {
            width: image_width,
            height: image_height,
            pattern,
            x0: x,
            y0: y,
            columns: width / pattern,
            rows: height / pattern,
            bit_depth,
        })
    }
    /// Width and height of the raw image, px.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }
    /// Number of samples of a raw frame.
    pub fn n_samples(&self) -> usize {
        self.width as usize * self.height as usize
    }
    /// Side of the pattern, px.
    pub fn pattern(&self) -> u32 {
        self.pattern
    }
    /// Left column and top row of the active area.
    pub fn origin(&self) -> [u32; 2] {
        [self.x0, self.y0]
    }
    /// Columns and rows of the cube.
    pub fn cells(&self) -> [u32; 2] {
        [self.columns, self.rows]
    }
    /// Number of cells of the cube.
    pub fn n_cells(&self) -> usize {
        self.columns as usize * self.rows as usize
    }
    /// Number of bands of the cube.
    pub fn n_bands(&self) -> usize {
        (self.pattern * self.pattern) as usize
    }
    /// Number of significant bits of a sample.
    pub fn bit_depth(&self) -> u32 {
        self.bit_depth
    }
    /// Smallest saturated sample: `2^bit_depth - 1`.
    pub fn saturation(&self) -> u16 {
        u16::MAX >> (16 - self.bit_depth)
    }
    /// The band of a sample of the raw image, by its index; the pattern continues outside the active area.
    pub(crate) fn band_of(&self, at: usize) -> usize {
        let phase = |v: usize, origin: u32| (v as i64 - i64::from(origin)).rem_euclid(i64::from(self.pattern)) as usize;
        let x = at % self.width as usize;
        let y = at / self.width as usize;
        phase(y, self.y0) * self.pattern as usize + phase(x, self.x0)
    }
    /// Width and height of all complete cells, px.
    pub(crate) fn area(&self) -> [usize; 2] {
        [(self.columns * self.pattern) as usize, (self.rows * self.pattern) as usize]
    }
    /// The samples of `row` of the area in a whole frame.
    pub(crate) fn area_row<'a, T>(&self, frame: &'a [T], row: usize) -> &'a [T] {
        let start = (self.y0 as usize + row) * self.width as usize + self.x0 as usize;
        &frame[start..][..self.area()[0]]
    }
    pub(crate) fn check_frame<T>(&self, what: &'static str, frame: &[T]) -> Result<(), SpectralError> {
        check_length(what, frame.len(), self.n_samples())
    }
}

pub(crate) fn check_length(what: &'static str, got: usize, expected: usize) -> Result<(), SpectralError> {
    if got == expected { Ok(()) } else { Err(SpectralError::Length { what, got, expected }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn real_sensors_have_the_cells_of_their_data_sheets() {
        let hs03 = Mosaic::new([2048, 1088], 4, [0, 32, 2048, 1024], 10).expect("sound");
        assert_eq!((hs03.cells(), hs03.n_bands(), hs03.saturation()), ([512, 256], 16, 1023));
        let hs02 = Mosaic::new([2048, 1088], 5, [0, 3, 2045, 1085], 10).expect("sound");
        assert_eq!((hs02.cells(), hs02.n_bands()), ([409, 217], 25));
    }

    #[test]
    fn partial_cells_at_the_rim_are_left_out() {
        let mosaic = Mosaic::new([13, 9], 4, [1, 1, 11, 8], 16).expect("sound");
        assert_eq!((mosaic.cells(), mosaic.area(), mosaic.saturation()), ([2, 2], [8, 8], u16::MAX));
    }

    #[test]
    fn invalid_geometry_is_rejected() {
        let area = |x, y, width, height| Mosaic::new([100, 50], 5, [x, y, width, height], 10);
        assert!(matches!(area(1, 0, 100, 50), Err(SpectralError::ActiveArea { x: 1, .. })));
        assert!(matches!(area(0, 48, 100, 3), Err(SpectralError::ActiveArea { .. })));
        assert!(matches!(area(0, 0, 4, 50), Err(SpectralError::ActiveArea { .. })));
        assert!(matches!(area(u32::MAX, 0, 5, 5), Err(SpectralError::ActiveArea { .. })));
        assert_eq!(Mosaic::new([100, 50], 6, [0, 0, 100, 50], 10), Err(SpectralError::Pattern(6)));
        assert_eq!(Mosaic::new([100, 50], 0, [0, 0, 100, 50], 10), Err(SpectralError::Pattern(0)));
        assert_eq!(Mosaic::new([100, 50], 4, [0, 0, 100, 50], 17), Err(SpectralError::BitDepth(17)));
    }
}
