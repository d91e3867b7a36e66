//! The `spectra` column.

use crate::choose::{Choices, Limits, NO_VIEW, Sources, View};
use crate::chunk::{CHUNK, Cloud, Extent};
use crate::occlusion::sights;
use messages::{CubeHeader, CubeView, MAX_BANDS, NO_SPECTRUM, SpectraHeader, SubmapPoint, pod::cast_slice_mut};
use rayon::prelude::*;

/// What the bands of a spectrum are: those of all mosaic cameras, one after another.
#[derive(Clone, Debug, PartialEq)]
pub struct Bands {
    wavelengths_nm: [f32; MAX_BANDS],
    cameras: [u8; MAX_BANDS],
    /// First band of each camera, and the end.
    starts: Vec<usize>,
}

impl Bands {
    /// From each camera's wavelengths. `None` if they are more than [`MAX_BANDS`] together, or the cameras more than 255.
    pub fn new(wavelengths_nm: &[Vec<f32>]) -> Option<Self> {
        let mut bands = Self { wavelengths_nm: [0.0; MAX_BANDS], cameras: [0; MAX_BANDS], starts: vec![0] };
        let mut n_bands = 0;
        for (camera, wavelengths_nm) in wavelengths_nm.iter().enumerate() {
            for wavelength_nm in wavelengths_nm {
                *bands.wavelengths_nm.get_mut(n_bands)? = *wavelength_nm;
                bands.cameras[n_bands] = u8::try_from(camera).ok()?;
                n_bands += 1;
            }
            bands.starts.push(n_bands);
        }
        Some(bands)
    }
    /// Bands of all cameras.
    pub fn n_bands(&self) -> usize {
        self.starts.last().copied().unwrap_or_default()
    }
}

/// A cube, in place.
#[derive(Clone, Copy)]
pub struct CubePicture<'a> {
    view: CubeView<'a>,
    header: &'a CubeHeader,
}

impl<'a> CubePicture<'a> {
    /// `None` unless the rows fit the header and there is at least one cell.
    pub fn new(header: &'a CubeHeader, rows: &'a [u32]) -> Option<Self> {
        let sound = header.width > 0 && header.height > 0 && header.pattern > 0;
        Some(Self { view: CubeView::new(header, rows).filter(|_| sound)?, header })
    }

    /// Index of the cell whose filters cover the pixel of the raw image.
    fn cell(&self, [u, v]: [f32; 2]) -> u32 {
        // A pixel's area reaches half a pixel to each side of its center.
        let index = |at: f32, first: u32, len: u32| {
            ((at + 0.5 - first as f32).max(0.0) as u32 / self.header.pattern).min(len - 1)
        };
        let column = index(u, self.header.x0, self.header.width);
        index(v, self.header.y0, self.header.height) * self.header.width + column
    }

    fn mask(&self, cell: u32) -> u32 {
        // Bits above the cube's bands would fall on another camera's.
        let in_use = (1_u64 << self.header.n_bands) - 1;
        self.view.masks()[cell as usize] & self.header.valid_bands & in_use as u32
    }
}

/// What one mosaic camera has seen.
#[derive(Default)]
pub struct CameraCubes<'a> {
    /// Its exposures.
    pub views: Vec<View<'a>>,
    /// Their cubes, by index.
    pub cubes: Vec<CubePicture<'a>>,
}

/// Cell of a point in a camera's cube.
#[derive(Clone, Copy)]
struct Cell {
    cube: u32,
    cell: u32,
}

const NO_CELL: Cell = Cell { cube: NO_VIEW, cell: 0 };

/// The spectra of a submap, found but not yet written: how many there are is known, so that the column gets its exact
/// size.
pub struct Found<'a> {
    bands: &'a Bands,
    cameras: &'a [CameraCubes<'a>],
    /// Per camera, per point.
    cells: Vec<Vec<Cell>>,
    /// Points with a spectrum, rising.
    seen: Vec<u32>,
    n_points: usize,
}

impl<'a> Found<'a> {
    /// Looks every point up in the best cube of each camera. Cells without any valid band count as unseen.
    pub fn new(cloud: &Cloud<'_>, bands: &'a Bands, cameras: &'a [CameraCubes<'a>], limits: Limits) -> Self {
        let points = cloud.points;
        let cells: Vec<Vec<Cell>> = cameras.iter().map(|camera| find_cells(cloud, camera, limits)).collect();
        let is_seen = |i: &usize| cells.iter().any(|cells| cells[*i].cube != NO_VIEW);
        let seen = (0..points.len()).filter(is_seen).map(|i| i as u32).collect();
        Self { bands, cameras, cells, seen, n_points: points.len() }
    }

    /// Rows that the column needs.
    pub fn n_rows(&self) -> usize {
        self.n_points + self.seen.len() * self.n_words()
    }

    /// Points with a spectrum.
    pub fn n_spectra(&self) -> usize {
        self.seen.len()
    }

    /// Two words of validity and the bands.
    fn n_words(&self) -> usize {
        2 + self.bands.n_bands()
    }

    /// The column's header.
    pub fn header(&self) -> SpectraHeader {
        SpectraHeader {
            n_points: self.n_points as u32,
            n_spectra: self.seen.len() as u32,
            n_bands: self.bands.n_bands() as u32,
            reserved: 0,
            wavelengths_nm: self.bands.wavelengths_nm,
            cameras: self.bands.cameras,
        }
    }

    /// Fills all of `rows`, which are [`Found::n_rows`].
    pub fn write_into(&self, rows: &mut [u32]) {
        let (indices, table) = rows.split_at_mut(self.n_points);
        indices.fill(NO_SPECTRUM);
        for (spectrum_idx, point_idx) in (0..).zip(&self.seen) {
            indices[*point_idx as usize] = spectrum_idx;
        }
        let points = self.seen.par_chunks(CHUNK);
        points.zip(table.par_chunks_mut(CHUNK * self.n_words())).for_each(|(points, table)| {
            for (point_idx, words) in points.iter().zip(table.chunks_exact_mut(self.n_words())) {
                self.write_spectrum(*point_idx as usize, words);
            }
        });
    }

    fn write_spectrum(&self, point_idx: usize, words: &mut [u32]) {
        words.fill(0);
        let (validity, reflectances) = words.split_at_mut(2);
        let reflectances = cast_slice_mut::<u32, f32>(reflectances);
        let mut bits = 0_u64;
        for ((camera, cells), start) in self.cameras.iter().zip(&self.cells).zip(&self.bands.starts) {
            let Cell { cube, cell } = cells[point_idx];
            let Some(cube) = camera.cubes.get(cube as usize) else { continue };
            let mask = cube.mask(cell);
            bits |= u64::from(mask) << start;
            for band in (0..cube.header.n_bands as usize).filter(|band| mask >> band & 1 == 1) {
                reflectances[start + band] = cube.view.band(band)[cell as usize];
            }
        }
        validity.copy_from_slice(&[bits as u32, (bits >> 32) as u32]);
    }
}

fn find_cells(cloud: &Cloud<'_>, camera: &CameraCubes<'_>, limits: Limits) -> Vec<Cell> {
    let sights = sights(cloud, &camera.views);
    let sources = Sources { cloud, views: &camera.views, sights: &sights, limits };
    let mut cells = vec![NO_CELL; cloud.points.len()];
    let find = |choices: &mut Choices, ((points, extent), cells): ((&[SubmapPoint], &Extent), &mut [Cell])| {
        choices.fill(points, extent, &sources);
        for (out, choice) in cells.iter_mut().zip(choices.iter()) {
            let Some((cube, (view, pixel))) = choice.and_then(|seen| Some((camera.cubes.get(seen.0)?, seen))) else {
                continue;
            };
            let cell = cube.cell(pixel);
            if cube.mask(cell) != 0 {
                *out = Cell { cube: view as u32, cell };
            }
        }
    };
    let chunks = cloud.points.par_chunks(CHUNK).zip(cloud.extents());
    chunks.zip(cells.par_chunks_mut(CHUNK)).for_each_init(Choices::default, find);
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_of_all_cameras_stand_one_after_another() {
        let bands = Bands::new(&[vec![700.0, 650.0], vec![], vec![500.0]]).expect("few");
        assert_eq!((bands.n_bands(), &bands.starts[..]), (3, &[0, 2, 2, 3][..]));
        assert_eq!(bands.wavelengths_nm[..4], [700.0, 650.0, 500.0, 0.0]);
        assert_eq!(bands.cameras[..3], [0, 0, 2]);
        assert_eq!(Bands::new(&[]).map(|bands| bands.n_bands()), Some(0));
        assert_eq!(Bands::new(&[vec![1.0; 40], vec![1.0; 25]]), None);
    }

    #[test]
    fn pixels_fall_into_the_cell_of_their_filters() {
        let header = CubeHeader { width: 3, height: 2, n_bands: 1, pattern: 4, x0: 2, y0: 1, ..CubeHeader::default() };
        let rows = [0; 12];
        let cube = CubePicture::new(&header, &rows).expect("fits");
        // Pixels 2 to 5 of rows 1 to 4 are cell 0; their areas reach from 1.5 to 5.5.
        for (pixel, cell) in
            [([1.5, 0.5], 0), ([5.49, 4.49], 0), ([5.51, 1.0], 1), ([2.0, 4.51], 3), ([13.49, 8.49], 5)]
        {
            assert_eq!(cube.cell(pixel), cell, "{pixel:?}");
        }
        assert!(CubePicture::new(&header, &rows[1..]).is_none());
        assert!(CubePicture::new(&CubeHeader { pattern: 0, ..header }, &rows).is_none());
    }
}
