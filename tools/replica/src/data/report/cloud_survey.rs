//! One pass over an evenly thinned part of the points of a run: top views, objects, colors by camera, covered area.

use super::finished_run::FinishedRun;
use formats::ply::{PlyRows, Vertices};
use geometry::BevGrid;
use image::RgbImage;
use pictures::cloud_picture::{Background, Camera, Canvas, CloudSummary, ColorBy, LoadedCloud, Palette, PictureSize};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use surveying::objects::{ObjectSummary, Objects};

/// Points of the pictures: about as many as their pixels. Bounds time and memory of the report.
const MAX_POINTS: u64 = 700_000;
/// Points from which bounds, path and ranges of values are taken.
const MAX_PROBES: u64 = 100_000;
/// Largest width and height of a top view, px.
const SIZE: [f64; 2] = [1000.0, 800.0];
/// Smallest side of a top view, px.
const MIN_SIDE: f64 = 160.0;
/// Side of the cells of the covered area, m, and largest number of cells.
const CELL_M: f64 = 1.0;
const MAX_CELLS: usize = 1 << 24;

/// Result of the pass over the points.
pub struct CloudSurvey {
    /// One point in `step` was read.
    pub step: usize,
    pub n_read: u64,
    /// Colored points that were read by index of the camera.
    pub by_camera: BTreeMap<u8, u64>,
    /// Cells of the ground with points, m^2. `None` if the clouds are too wide.
    pub area_m2: Option<f64>,
    /// Objects, sorted by number of points, the largest first; the number is an estimate from the points that were read.
    pub objects: Vec<ObjectSummary>,
    /// Top views by [`CloudSurvey::COLORINGS`]; `None` for a column that the clouds lack.
    pub views: [Option<RgbImage>; 3],
    /// px per m.
    pub scale: f64,
}

/// The clouds of a run, of which a part is read.
struct Thinned {
    files: Vec<PathBuf>,
    n_points: u64,
}

impl Thinned {
    /// About `n` of all points, file by file in their order; as many files as there are threads are read at once. Returns the step.
    fn each(&self, n: u64, mut take: impl FnMut(&Vertices) -> anyhow::Result<()>) -> anyhow::Result<usize> {
        let step = self.n_points.div_ceil(n).max(1) as usize;
        for files in self.files.chunks(rayon::current_num_threads().max(1)) {
            let read = |file: &PathBuf| PlyRows::open(file)?.thinned(step);
            let clouds: Vec<Vertices> = files.par_iter().map(read).collect::<Result<_, _>>()?;
            clouds.iter().try_for_each(&mut take)?;
        }
        Ok(step)
    }
}

impl CloudSurvey {
    /// Colorings of the top views.
    pub const COLORINGS: [ColorBy; 3] = [ColorBy::Color, ColorBy::Class, ColorBy::Instance];

    /// `None` without points.
    pub fn from_run(run: &FinishedRun) -> anyhow::Result<Option<Self>> {
        let clouds = run.index.iter().flat_map(|index| &index.clouds).filter(|cloud| cloud.n_points > 0);
        let files = clouds.clone().map(|cloud| run.folder.join(&cloud.file)).collect();
        let thinned = Thinned { files, n_points: clouds.map(|cloud| cloud.n_points).sum() };
        let mut summary = CloudSummary::default();
        thinned.each(MAX_PROBES, |vertices| {
            summary.add(std::path::Path::new(""), &LoadedCloud::from_vertices(vertices)?);
            Ok(())
        })?;
        let Some(bounds) = summary.bounds() else { return Ok(None) };
        let size = size(Camera::surroundings(bounds, summary.path()));
        let camera = Camera::top_view(bounds, summary.path(), size);
        let palettes = Self::COLORINGS.map(|by| Palette::new(by, &summary));
        let corner = |p: [f64; 3]| [p[0], p[1]];
        let grid = BevGrid::covering(corner(bounds[0]), corner(bounds[1]), CELL_M, MAX_CELLS);
        let mut covered = vec![false; grid.as_ref().map_or(0, BevGrid::n_cells)];
        let mut canvas = Canvas::new(size);
        let mut objects = Objects::default();
        let mut by_camera = BTreeMap::new();
        let mut n_read = 0;
        let mut has = [false; 3];
        let step = thinned.each(MAX_POINTS, |vertices| {
            let cloud = LoadedCloud::from_vertices(vertices)?;
            let cameras = if vertices.has("camera") { vertices.u8s("camera")? } else { Vec::new() };
            for camera in cameras.iter().filter(|camera| **camera != messages::UNSEEN) {
                *by_camera.entry(*camera).or_default() += 1;
            }
            has[0] |= cloud.has_color();
            has[1] |= cloud.classes().is_some();
            has[2] |= cloud.instances().is_some();
            if cloud.classes().is_some() && cloud.instances().is_some() {
                objects.add(vertices)?;
            }
            n_read += cloud.len() as u64;
            for i in 0..cloud.len() {
                let position = cloud.position(i);
                canvas.splat(&camera, position, palettes.each_ref().map(|palette| palette.color(&cloud, 0, i)));
                let cell = grid.as_ref().and_then(|grid| Some((grid.cell(position[0], position[1])?, grid.cols)));
                if let Some(((row, col), cols)) = cell {
                    covered[row * cols + col] = true;
                }
            }
            Ok(())
        })?;
        // Without colors from a camera the picture would show intensities.
        has[0] &= !by_camera.is_empty();
        let mut pixels = canvas.finish(Background::White).map(Some);
        let width = size.width as u32;
        let height = size.height as u32;
        let views = std::array::from_fn(|k| RgbImage::from_raw(width, height, pixels[k].take().filter(|_| has[k])?));
        let mut objects = objects.summaries();
        for object in &mut objects {
            object.n_points *= step as u64;
        }
        objects.sort_by_key(|object| (std::cmp::Reverse(object.n_points), object.id));
        let area_m2 = grid.map(|grid| covered.iter().filter(|cell| **cell).count() as f64 * grid.cell_m.powi(2));
        Ok(Some(Self { step, n_read, by_camera, area_m2, objects, views, scale: camera.px_per_m() }))
    }
}

/// Size of the largest picture of these surroundings within [`SIZE`].
fn size(surroundings: [[f64; 2]; 2]) -> PictureSize {
    let sides_m = surroundings.map(|[low, high]| (high - low).max(1.0));
    let scale = (SIZE[0] / sides_m[0]).min(SIZE[1] / sides_m[1]);
    let [width, height] = sides_m.map(|side_m| (side_m * scale).round().max(MIN_SIDE) as usize);
    PictureSize { width, height }
}
