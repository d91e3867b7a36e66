//! Errors of the terrain of a delivery of a simulated drive, against the exact town.
//!
//! `terrain_errors RUN DRIVE`: the output folder of a run, and the simulated drive. The rasters are written as `replica deliver --crs local
//! --rasters` does. The path of the run is aligned with the true path (heading and translation). From the heights of each square of 50 m, a
//! plane through the errors of its measured cells is subtracted, because the path drifts and tilts by some centimeters.
//!
//! The outline is the terrain with its holes filled: cells with terrain within 8 m in each of four directions, where the town has ground.

use anyhow::bail;
use flate2::read::ZlibDecoder;
use geometry::{Point3, Vector3};
use messages::GROUND_CLASSES;
use scene::CompletedTerrain;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use studies::exact_town::{ExactTown, plane};
use surveying::{CloudOptions, RasterOptions, RunFolder, TargetFrame, write_rasters};

/// Side of the cells, m.
const CELL_M: f64 = 0.2;
/// Rays to the ground start this far above the terrain, below parked cars, m.
const ABOVE_M: f64 = 0.15;
/// The path of a run may be this far off in height, m.
const REACH_M: f64 = 1.5;
/// Side of the squares with one plane, m.
const SQUARE_M: f64 = 50.0;
/// Reach of the outline, cells: 8 m.
const OUTLINE_CELLS: usize = 40;
/// Values of `terrain_source.tif`.
const MEASURED: f32 = 1.0;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [run, drive] = &arguments[..] else { bail!("RUN DRIVE") };
    let run = RunFolder::open(Path::new(run))?;
    let town = ExactTown::open(Path::new(drive), &run.trajectory)?;
    let out = tempfile::tempdir()?;
    let runs = std::slice::from_ref(&run);
    let terrain = CompletedTerrain::new(runs, out.path(), |_| ())?;
    let rasters = RasterOptions {
        cell_mm: (CELL_M * 1000.0) as u32,
        class_colors: [[0; 3]; 256],
        world: Some(&terrain),
        keeps_nodes: false,
    };
    let options = CloudOptions {
        has_bands: false,
        has_ground_as_2: false,
        system: String::new(),
        software: String::new(),
        note: String::new(),
    };
    write_rasters(runs, &TargetFrame::local(run.georeference.as_ref()), &options, &rasters, out.path())?;
    let heights = Raster::read(&out.path().join("terrain.tif"))?;
    let sources = Raster::read(&out.path().join("terrain_source.tif"))?;
    coverage(&heights, &sources, &town);
    errors(&heights, &sources, &town);
    Ok(())
}

/// Height above the true ground of a place of the run, m; NaN without ground within `reach_m` below `above_m` above it.
fn off_m(town: &ExactTown, [x, y, z]: [f64; 3], above_m: f64, reach_m: f64) -> f64 {
    let hit = town.below(&(town.town_from_run * Point3::new(x, y, z + above_m)), reach_m);
    let ground = hit.filter(|hit| GROUND_CLASSES.contains(&hit.surface.class));
    ground.map_or(f64::NAN, |hit| f64::from(hit.range_m) - above_m)
}

/// The first level of a raster with one band, rows from north to south.
struct Raster {
    values: Vec<f32>,
    width: usize,
    /// Upper left corner, m.
    corner: [f64; 2],
    no_data: f32,
}

impl Raster {
    fn read(path: &Path) -> anyhow::Result<Self> {
        let bytes = std::fs::read(path)?;
        let number = |at: usize, n: usize| bytes[at..at + n].iter().rev().fold(0, |sum, b| sum << 8 | usize::from(*b));
        let first = number(4, 4);
        let entries: BTreeMap<usize, usize> =
            (0..number(first, 2)).map(|k| first + 2 + 12 * k).map(|at| (number(at, 2), at)).collect();
        // Start of the values of a tag whose values have this many bytes.
        let start = |tag: usize, n_bytes: usize| {
            let at = entries[&tag];
            if number(at + 4, 4) * n_bytes <= 4 { at + 8 } else { number(at + 8, 4) }
        };
        let [width, height] = [256, 257].map(|tag| number(start(tag, 4), 4));
        let side = number(start(322, 2), 2);
        let n_bytes = number(start(258, 2), 2) / 8;
        let tie = start(33_922, 8);
        let double = |at: usize| f64::from_bits(number(at, 8) as u64);
        let mut values = vec![f32::NAN; width * height];
        for k in 0..(width / side) * (height / side) {
            let [at, n] = [324, 325].map(|tag| number(start(tag, 4) + 4 * k, 4));
            let mut tile = Vec::new();
            ZlibDecoder::new(&bytes[at..at + n]).read_to_end(&mut tile)?;
            for (idx, cell) in tile.chunks_exact(n_bytes).enumerate() {
                let row = k / (width / side) * side + idx / side;
                let column = k % (width / side) * side + idx % side;
                values[row * width + column] = match *cell {
                    [value] => f32::from(value),
                    [a, b, c, d] => f32::from_le_bytes([a, b, c, d]),
                    _ => bail!("{}: {n_bytes} bytes a cell", path.display()),
                };
            }
        }
        let no_data = if n_bytes == 1 { 255.0 } else { -9999.0 };
        Ok(Self { values, width, corner: [double(tie + 24), double(tie + 32)], no_data })
    }

    /// Middle of a cell, m.
    fn place(&self, idx: usize) -> [f64; 2] {
        let [column, row] = [idx % self.width, idx / self.width].map(|number| (number as f64 + 0.5) * CELL_M);
        [self.corner[0] + column, self.corner[1] - row]
    }

    fn get(&self, idx: usize) -> Option<f32> {
        self.values.get(idx).copied().filter(|value| *value != self.no_data)
    }
}

/// Cells of the outline: with terrain, or with terrain within reach to all four sides. The height is the mean of the nearest of both.
fn outline(heights: &Raster) -> Vec<Option<f64>> {
    let n_rows = heights.values.len() / heights.width;
    let cell = |idx: usize| {
        if let Some(height) = heights.get(idx) {
            return Some(f64::from(height));
        }
        let [column, row] = [(idx % heights.width) as i64, (idx / heights.width) as i64];
        let found = [[1, 0], [-1, 0], [0, 1], [0, -1]].map(|[x, y]| {
            (1..=OUTLINE_CELLS as i64).find_map(|k| {
                let [x, y] = [column + k * x, row + k * y];
                let is_inside = (0..heights.width as i64).contains(&x) && (0..n_rows as i64).contains(&y);
                heights.get(is_inside.then(|| y as usize * heights.width + x as usize)?).map(f64::from)
            })
        });
        let all: Option<Vec<f64>> = found.into_iter().collect();
        all.map(|all| all.iter().sum::<f64>() / 4.0)
    };
    (0..heights.values.len()).map(cell).collect()
}

fn coverage(heights: &Raster, sources: &Raster, town: &ExactTown) {
    let mut n = [0_usize; 3];
    for (idx, height) in outline(heights).into_iter().enumerate() {
        let Some(height) = height else { continue };
        let [x, y] = heights.place(idx);
        let is_ground = !off_m(town, [x, y, height], REACH_M, 2.0 * REACH_M).is_nan();
        let is_known = heights.get(idx).is_some();
        if is_ground || is_known {
            n[0] += 1;
            n[1] += usize::from(is_known);
            n[2] += usize::from(sources.get(idx) == Some(MEASURED));
        }
    }
    let share = |k: usize| 100.0 * n[k] as f64 / n[0] as f64;
    println!(
        "outline: {:.0} m2; measured {:.1} %, with completed cells {:.1} %",
        n[0] as f64 * CELL_M * CELL_M,
        share(2),
        share(1)
    );
}

/// A cell of the terrain: its middle, and its height above the true ground after corrections, m; NaN without ground.
struct Cell {
    place: [f64; 3],
    off_m: f64,
    is_measured: bool,
}

impl Cell {
    /// Place and error in height.
    fn error(&self) -> [f64; 3] {
        [self.place[0], self.place[1], self.off_m]
    }
}

fn errors(heights: &Raster, sources: &Raster, town: &ExactTown) {
    let mut squares: BTreeMap<[i64; 2], Vec<Cell>> = BTreeMap::new();
    for idx in 0..heights.values.len() {
        let Some(height) = heights.get(idx) else { continue };
        let [x, y] = heights.place(idx);
        let is_measured = sources.get(idx) == Some(MEASURED);
        let cell = Cell { place: [x, y, f64::from(height)], off_m: f64::NAN, is_measured };
        squares.entry([x, y].map(|value| (value / SQUARE_M).floor() as i64)).or_default().push(cell);
    }
    for cells in squares.values_mut() {
        // A first plane from rays that start above vehicles, which are not ground.
        for cell in cells.iter_mut() {
            cell.off_m = off_m(town, cell.place, REACH_M, 2.0 * REACH_M);
        }
        let mut offs: Vec<f64> = cells.iter().map(|cell| cell.off_m).filter(|off| off.is_finite()).collect();
        offs.sort_by(f64::total_cmp);
        let middle_m = offs.get(offs.len() / 2).copied().unwrap_or_default();
        let near = cells.iter().filter(|cell| cell.is_measured && (cell.off_m - middle_m).abs() < 0.5);
        let first = plane(near.map(Cell::error));
        for cell in cells.iter_mut() {
            let [x, y, z] = cell.place;
            cell.off_m = off_m(town, [x, y, z - first.dot(&Vector3::new(1.0, x, y))], ABOVE_M, 2.0 * ABOVE_M + 0.3);
        }
        let second = plane(cells.iter().filter(|cell| cell.is_measured && cell.off_m.abs() < 0.5).map(Cell::error));
        for cell in cells {
            cell.off_m -= second.dot(&Vector3::new(1.0, cell.place[0], cell.place[1]));
        }
    }
    for (name, is_measured) in [("measured", true), ("completed", false)] {
        let cells = || squares.values().flatten().filter(|cell| cell.is_measured == is_measured);
        let n = cells().count();
        let found: Vec<f64> = cells().map(|cell| cell.off_m.abs()).filter(|off| off.is_finite()).collect();
        let share = |limit_m: f64| 100.0 * found.iter().filter(|off| **off < limit_m).count() as f64 / n as f64;
        let rms_m = (found.iter().map(|off| off * off).sum::<f64>() / found.len() as f64).sqrt();
        println!(
            "{name}: {n} cells, RMS {rms_m:.3} m, {:.1} % within 5 cm, {:.1} % within 10 cm; {:.2} % without ground below",
            share(0.05),
            share(0.1),
            100.0 * (n - found.len()) as f64 / n as f64
        );
    }
}
