//! The `spectra` column.

use crate::bands::Bands;
use crate::camera::ProjectionCamera;
use crate::candidates::{AgeLimits, Candidates};
use crate::choice::{Choices, NO_EXPOSURE, PointChoice};
use crate::chunk::{CHUNK, Chunk};
use crate::cube_image::CubeImage;
use crate::exposure::PosedExposure;
use crate::occlusion::visibility_maps;
use crate::points::SubmapPoints;
use crate::visibility::VisibilityMap;
use geometry::Pose;
use messages::{NO_SPECTRUM, SpectraHeader};
use rayon::prelude::*;

/// The exposures of one mosaic camera.
#[derive(Default)]
pub struct CameraCubes<'a> {
    /// Poses and usable areas.
    pub exposures: Vec<PosedExposure<'a>>,
    /// The cube of each exposure, by index.
    pub cubes: Vec<CubeImage<'a>>,
}

impl<'a> CameraCubes<'a> {
    /// Adds a cube of the camera, with `odom_from_body` at its stamp and `odom_from_submap`.
    pub fn add(&mut self, camera: &'a ProjectionCamera, cube: CubeImage<'a>, poses: [&Pose; 2], stamp: i64) {
        self.exposures.push(camera.exposure_of_area(stamp, poses[0], poses[1], cube.area()));
        self.cubes.push(cube);
    }
}

/// The cell of a point in a cube of a camera.
#[derive(Clone, Copy)]
struct Cell {
    cube: u32,
    cell: u32,
}

const NO_CELL: Cell = Cell { cube: NO_EXPOSURE, cell: 0 };

/// The cells of the points of a chunk that have a spectrum.
struct Batch {
    /// Indices of the points in the submap, ascending.
    points: Vec<u32>,
    /// For each camera, the cell of each point.
    cells: Vec<Vec<Cell>>,
}

/// The spectra of a submap before they are written. Their number is known, so a message of the exact size can be
/// allocated.
pub struct SpectraColumn<'a> {
    bands: &'a Bands,
    cameras: &'a [CameraCubes<'a>],
    /// Batches in the order of the points. Chunks without spectra have no batch.
    batches: Vec<Batch>,
    n_points: usize,
    n_spectra: usize,
}

impl<'a> SpectraColumn<'a> {
    /// Finds the cell of every point in the chosen cube of each camera. Cells without a valid band are ignored.
    pub fn new(points: &SubmapPoints<'_>, bands: &'a Bands, cameras: &'a [CameraCubes<'a>], limits: AgeLimits) -> Self {
        let visibility: Vec<Vec<VisibilityMap>> =
            cameras.iter().map(|camera| visibility_maps(points, &camera.exposures)).collect();
        let pairs = cameras.iter().zip(&visibility);
        let candidates: Vec<Candidates<'_>> = pairs
            .map(|(camera, visibility)| Candidates { points, exposures: &camera.exposures, visibility, limits })
            .collect();
        let find = |(choices, chunk): &mut (Choices, Chunk), chunk_idx: usize| {
            points.read_chunk(chunk_idx, chunk);
            let find_cells = |(camera, candidates): (&CameraCubes<'_>, &Candidates<'_>)| {
                choices.choose(chunk, candidates);
                find_cells(choices, camera)
            };
            let cells: Vec<Vec<Cell>> = cameras.iter().zip(&candidates).map(find_cells).collect();
            Batch::new(chunk_idx * CHUNK, &cells)
        };
        let chunks = (0..points.n_chunks()).into_par_iter();
        let batches: Vec<Batch> = chunks.map_init(Default::default, find).flatten_iter().collect();
        let n_spectra = batches.iter().map(|batch| batch.points.len()).sum();
        Self { bands, cameras, batches, n_points: points.rows.len(), n_spectra }
    }

    /// Number of rows of the message.
    pub fn n_rows(&self) -> usize {
        self.n_points + self.n_spectra * self.n_words()
    }

    /// Number of points with a spectrum.
    pub fn n_spectra(&self) -> usize {
        self.n_spectra
    }

    /// Words per spectrum: two of validity and one per band.
    fn n_words(&self) -> usize {
        2 + self.bands.n_bands()
    }

    /// The header of the message.
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

    /// Fills all of `rows`, which must be [`SpectraColumn::n_rows`] long.
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

    /// The region of each point, from the first camera whose cube has one there; 0 = no region.
    pub fn regions(&self) -> Vec<u32> {
        let mut rows = vec![0; self.n_points];
        for batch in &self.batches {
            for (i, point) in batch.points.iter().enumerate() {
                let regions = self.cameras.iter().zip(&batch.cells).filter_map(|(camera, cells)| {
                    let Cell { cube, cell } = cells[i];
                    (cube != NO_EXPOSURE).then(|| camera.cubes[cube as usize].region(cell))
                });
                rows[*point as usize] = regions.into_iter().find(|region| *region != 0).unwrap_or(0);
            }
        }
        rows
    }

    fn write_batch(&self, batch: &Batch, table: &mut [u32]) {
        table.fill(0);
        let n_words = self.n_words();
        for ((camera, cells), start) in self.cameras.iter().zip(&batch.cells).zip(&self.bands.starts) {
            for (cube_idx, cube) in (0..).zip(&camera.cubes) {
                let of_cube = cells.iter().enumerate().filter(|(_, cell)| cell.cube == cube_idx);
                // First word of the spectrum, its cell, and the valid bands of the cell.
                let places: Vec<(usize, usize, u32)> =
                    of_cube.map(|(i, cell)| (i * n_words, cell.cell as usize, cube.valid_bands(cell.cell))).collect();
                for (at, _, mask) in &places {
                    let bits = u64::from(*mask) << start;
                    table[*at] |= bits as u32;
                    table[at + 1] |= (bits >> 32) as u32;
                }
                if places.is_empty() {
                    continue;
                }
                // Band by band, because neighboring points are adjacent in the plane of a band.
                for band in 0..cube.n_bands() {
                    let plane = cube.band(band);
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
    /// Takes the cells of each camera for the points of a chunk; [`NO_CELL`] marks points outside its view. `None` if
    /// there is no cell at all.
    fn new(first_point: usize, cells: &[Vec<Cell>]) -> Option<Self> {
        let has_cell = |i: &usize| cells.iter().any(|cells| cells.get(*i).is_some_and(|cell| cell.cube != NO_EXPOSURE));
        let indices: Vec<usize> = (0..CHUNK).filter(has_cell).collect();
        let of_camera = |cells: &Vec<Cell>| indices.iter().map(|i| cells.get(*i).copied().unwrap_or(NO_CELL)).collect();
        (!indices.is_empty()).then(|| Self {
            points: indices.iter().map(|i| (first_point + i) as u32).collect(),
            cells: cells.iter().map(of_camera).collect(),
        })
    }
}

/// The cells of the points of a chunk in the chosen cubes of a camera. Empty if the camera sees no point of the chunk.
fn find_cells(choices: &Choices, camera: &CameraCubes<'_>) -> Vec<Cell> {
    let mut cells = Vec::new();
    for PointChoice { i, exposure, pixel } in choices.chosen() {
        let cube = &camera.cubes[exposure];
        let cell = cube.cell(pixel);
        if cube.valid_bands(cell) != 0 {
            cells.resize(CHUNK, NO_CELL);
            cells[i] = Cell { cube: exposure as u32, cell };
        }
    }
    cells
}
