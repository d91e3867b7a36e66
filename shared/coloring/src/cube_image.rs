//! The cells of a spectral exposure.

use crate::ProjectionCamera;
use messages::{CubeHeader, CubeView};

/// A reflectance cube, in place.
#[derive(Clone, Copy)]
pub struct CubeImage<'a> {
    planes: CubeView<'a>,
    header: &'a CubeHeader,
}

impl<'a> CubeImage<'a> {
    /// `None` unless the rows fit the header and there is at least one cell.
    pub fn new(header: &'a CubeHeader, rows: &'a [u32]) -> Option<Self> {
        let sound = header.width > 0 && header.height > 0 && header.pattern > 0;
        Some(Self { planes: CubeView::new(header, rows).filter(|_| sound)?, header })
    }

    /// `None` unless the cells are inside the image of the camera and the rows fit the header. The filter pattern of the
    /// camera has sides of `pattern` px.
    pub fn for_camera(
        camera: &ProjectionCamera,
        pattern: u32,
        header: &'a CubeHeader,
        rows: &'a [u32],
    ) -> Option<Self> {
        let [width, height] = camera.size().map(u64::from);
        let end = |first: u32, n_cells: u32| u64::from(first) + u64::from(n_cells) * u64::from(header.pattern);
        let fits = end(header.x0, header.width) <= width
            && end(header.y0, header.height) <= height
            && (header.pattern == pattern || header.pattern == 1);
        Self::new(header, rows).filter(|_| fits)
    }

    /// Number of bands.
    pub fn n_bands(&self) -> usize {
        self.header.n_bands as usize
    }

    /// The part of the raw image that the cube covers: left, top, width, height, px.
    pub fn area(&self) -> [u32; 4] {
        let CubeHeader { x0, y0, width, height, pattern, .. } = *self.header;
        [x0, y0, width * pattern, height * pattern]
    }

    /// Reflectances of one band, cell by cell.
    pub fn band(&self, band: usize) -> &'a [f32] {
        self.planes.band(band)
    }

    /// Number of the region of a cell; 0 = no region.
    pub fn region(&self, cell: u32) -> u32 {
        self.planes.regions().map_or(0, |regions| regions[cell as usize])
    }

    /// Index of the cell whose filters cover the pixel of the raw image.
    pub fn cell(&self, [u, v]: [f32; 2]) -> u32 {
        // A pixel's area reaches half a pixel to each side of its center.
        let index = |at: f32, first: u32, len: u32| {
            ((at + 0.5 - first as f32).max(0.0) as u32 / self.header.pattern).min(len - 1)
        };
        let column = index(u, self.header.x0, self.header.width);
        index(v, self.header.y0, self.header.height) * self.header.width + column
    }

    /// Valid bands of a cell, one bit each.
    pub fn valid_bands(&self, cell: u32) -> u32 {
        // Bits above the bands of this cube would be counted for another camera.
        let in_use = (1_u64 << self.header.n_bands) - 1;
        self.planes.masks()[cell as usize] & self.header.valid_bands & in_use as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixel_belongs_to_cell_of_its_filters() {
        let header = CubeHeader { width: 3, height: 2, n_bands: 1, pattern: 4, x0: 2, y0: 1, ..CubeHeader::default() };
        let rows = [0; 12];
        let cube = CubeImage::new(&header, &rows).expect("fits");
        // Pixels 2 to 5 of rows 1 to 4 are cell 0; their areas reach from 1.5 to 5.5.
        for (pixel, cell) in
            [([1.5, 0.5], 0), ([5.49, 4.49], 0), ([5.51, 1.0], 1), ([2.0, 4.51], 3), ([13.49, 8.49], 5)]
        {
            assert_eq!(cube.cell(pixel), cell, "{pixel:?}");
        }
        assert!(CubeImage::new(&header, &rows[1..]).is_none());
        assert!(CubeImage::new(&CubeHeader { pattern: 0, ..header }, &rows).is_none());
    }
}
