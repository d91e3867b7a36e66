//! The `spectra` column.

use crate::choose::{Choices, Limits, NO_VIEW, Sources, View};
use crate::chunk::{CHUNK, Chunk};
use crate::cloud::Cloud;
use crate::occlusion::{Sight, sights};
use messages::{CubeHeader, CubeView, MAX_BANDS, NO_SPECTRUM, SpectraHeader};
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

/// The spectra of a chunk's points, found but not yet written.
struct Batch {
    /// Index in the submap, rising.
    points: Vec<u32>,
    /// For each camera, of each of the points.
    cells: Vec<Vec<Cell>>,
}

/// The spectra of a submap, found but not yet written: how many there are is known, so that the column gets its exact
/// size.
pub struct Found<'a> {
    bands: &'a Bands,
    cameras: &'a [CameraCubes<'a>],
    /// In the order of the points. Chunks without spectra have none.
    batches: Vec<Batch>,
    n_points: usize,
    n_spectra: usize,
}

impl<'a> Found<'a> {
    /// Looks every point up in the best cube of each camera. Cells without any valid band count as unseen.
    pub fn new(cloud: &Cloud<'_>, bands: &'a Bands, cameras: &'a [CameraCubes<'a>], limits: Limits) -> Self {
        let sights: Vec<Vec<Sight>> = cameras.iter().map(|camera| sights(cloud, &camera.views)).collect();
        let pairs = cameras.iter().zip(&sights);
        let sources: Vec<Sources<'_>> =
            pairs.map(|(camera, sights)| Sources { cloud, views: &camera.views, sights, limits }).collect();
        let find = |choices: &mut Choices, (chunk_idx, chunk): (usize, &Chunk)| {
            let find_cells = |(camera, sources): (&CameraCubes<'_>, &Sources<'_>)| {
                choices.fill(chunk, sources);
                find_cells(choices, camera)
            };
            let cells: Vec<Vec<Cell>> = cameras.iter().zip(&sources).map(find_cells).collect();
            Batch::new(chunk_idx * CHUNK, &cells)
        };
        let chunks = cloud.chunks().par_iter().enumerate();
        let batches: Vec<Batch> = chunks.map_init(Choices::default, find).flatten_iter().collect();
        let n_spectra = batches.iter().map(|batch| batch.points.len()).sum();
        Self { bands, cameras, batches, n_points: cloud.points.len(), n_spectra }
    }

    /// Rows that the column needs.
    pub fn n_rows(&self) -> usize {
        self.n_points + self.n_spectra * self.n_words()
    }

    /// Points with a spectrum.
    pub fn n_spectra(&self) -> usize {
        self.n_spectra
    }

    /// Two words of validity and the bands.
    fn n_words(&self) -> usize {
        2 + self.bands.n_bands()
    }

    /// The column's header.
    pub fn header(&self) -> SpectraHeader {
        SpectraHeader {
            n_points: self.n_points as u32,
            n_spectra: self.n_spectra as u32,
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
        for (spectrum_idx, point_idx) in (0..).zip(self.batches.iter().flat_map(|batch| &batch.points)) {
            indices[*point_idx as usize] = spectrum_idx;
        }
        let mut rest = table;
        let tables: Vec<&mut [u32]> = (self.batches.iter())
            .filter_map(|batch| rest.split_off_mut(..batch.points.len() * self.n_words()))
            .collect();
        let batches = self.batches.par_iter().zip(tables);
        batches.for_each(|(batch, table)| self.write_batch(batch, table));
    }

    fn write_batch(&self, batch: &Batch, table: &mut [u32]) {
        table.fill(0);
        let n_words = self.n_words();
        for ((camera, cells), start) in self.cameras.iter().zip(&batch.cells).zip(&self.bands.starts) {
            for (cube_idx, cube) in (0..).zip(&camera.cubes) {
                let of_cube = cells.iter().enumerate().filter(|(_, cell)| cell.cube == cube_idx);
                // First word of a spectrum, its cell, and which bands are valid there.
                let places: Vec<(usize, usize, u32)> =
                    of_cube.map(|(i, cell)| (i * n_words, cell.cell as usize, cube.mask(cell.cell))).collect();
                for (at, _, mask) in &places {
                    let bits = u64::from(*mask) << start;
                    table[*at] |= bits as u32;
                    table[at + 1] |= (bits >> 32) as u32;
                }
                if places.is_empty() {
                    continue;
                }
                // Band by band, because neighbors among the points are neighbors in the plane of a band.
                for band in 0..cube.header.n_bands as usize {
                    let plane = cube.view.band(band);
                    for (at, cell, mask) in &places {
                        let is_valid = mask >> band & 1 == 1;
                        table[at + 2 + start + band] = if is_valid { plane[*cell].to_bits() } else { 0 };
                    }
                }
            }
        }
    }
}

impl Batch {
    /// From the cells that each camera has for the points of a chunk, [`NO_CELL`] where it has none. `None` if no point has any.
    fn new(first_point: usize, cells: &[Vec<Cell>]) -> Option<Self> {
        let is_seen = |i: &usize| cells.iter().any(|cells| cells.get(*i).is_some_and(|cell| cell.cube != NO_VIEW));
        let places: Vec<usize> = (0..CHUNK).filter(is_seen).collect();
        let of_camera = |cells: &Vec<Cell>| places.iter().map(|i| cells.get(*i).copied().unwrap_or(NO_CELL)).collect();
        (!places.is_empty()).then(|| Self {
            points: places.iter().map(|i| (first_point + i) as u32).collect(),
            cells: cells.iter().map(of_camera).collect(),
        })
    }
}

/// The cells of the points for which views of the camera were chosen; nothing at all if there are none.
fn find_cells(choices: &Choices, camera: &CameraCubes<'_>) -> Vec<Cell> {
    let mut cells = Vec::new();
    for (i, view, pixel) in choices.seen() {
        let cube = &camera.cubes[view];
        let cell = cube.cell(pixel);
        if cube.mask(cell) != 0 {
            cells.resize(CHUNK, NO_CELL);
            cells[i] = Cell { cube: view as u32, cell };
        }
    }
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
