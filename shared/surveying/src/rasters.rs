//! Rasters seen from above: terrain, height, color and class, as Cloud-Optimized GeoTIFF.
//!
//! A tile of the images is also the unit of work: its points come from a temporary file, and each overview tile is
//! computed from the four tiles below it. Memory therefore does not grow with the length of the drive.

mod cells;
mod directory;
mod geotiff;

use crate::cloud_delivery::{CloudDelivery, CloudOptions};
use crate::error::DeliverError;
use crate::las::{FORMAT_7_BYTES, color_of, position_of, source_of};
use crate::run_folder::RunFolder;
use crate::spool::Spool;
use crate::target_frame::TargetFrame;
use cells::{Cells, TILE};
use geotiff::{Content, Grid, ImageTiles};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::Path;

/// Number of points read at a time.
const POINTS_AT_A_TIME: usize = 1 << 18;

/// Settings of the rasters.
#[derive(Clone, Copy, Debug)]
pub struct RasterOptions {
    /// Side of a cell, mm.
    pub cell_mm: u32,
    /// sRGB by class id.
    pub class_colors: [[u8; 3]; 256],
}

/// Column and row of a tile from the origin of the coordinates; rows increase to the north.
type Tile = (i64, i64);

/// Writes `height.tif` and, if the runs have classes or colors, `terrain.tif` and `class.tif` (classes) and `color.tif`
/// (colors), and for several runs with classes `difference.tif` (differences between runs) into the existing folder `out`. Returns the names of the files. Points on moving objects are left out.
pub fn write_rasters(
    runs: &[RunFolder],
    frame: &TargetFrame<'_>,
    options: &CloudOptions,
    RasterOptions { cell_mm, class_colors }: RasterOptions,
    out: &Path,
) -> Result<Vec<&'static str>, DeliverError> {
    let options = CloudOptions { has_bands: false, ..options.clone() };
    let mut delivery = CloudDelivery::new(runs, frame, &options)?;
    let cell = i64::from(cell_mm);
    let [x0, y0, _] = delivery.facts.offset_m.map(|offset| offset as i64 * 1000);
    let side = cell * TILE as i64;
    let tile_of =
        move |[x, y, _]: [i32; 3]| ((i64::from(x) + x0).div_euclid(side), (i64::from(y) + y0).div_euclid(side));
    let points = delivery.spool(out, tile_of, |_| ())?;
    let fields = delivery.extra_offsets();
    let reader = CellReader {
        points: &points,
        fields,
        origin: [x0, y0],
        cell,
        record_bytes: delivery.facts.record_bytes,
        has_several_runs: runs.len() > 1,
    };
    let mut images = vec![("height.tif", Content::Height)];
    if fields.class.is_some() {
        images.extend([("terrain.tif", Content::Terrain), ("class.tif", Content::Class(&class_colors))]);
        images.extend((runs.len() > 1).then_some(("difference.tif", Content::Difference)));
    }
    if fields.camera.is_some() {
        images.push(("color.tif", Content::Color));
    }
    let tiles: BTreeSet<Tile> = points.keys().into_iter().map(|tile| tile.key).collect();
    let Some(pyramid) = Pyramid::new(&tiles) else { return Ok(Vec::new()) };
    let stores: Result<Vec<ImageTiles<'_>>, DeliverError> =
        images.iter().map(|(_, content)| ImageTiles::create(out, *content)).collect();
    let stores = stores?;
    pyramid.build(pyramid.levels.len() - 1, (0, 0), &reader, &stores)?;
    let grid = Grid {
        low: pyramid.low,
        size: pyramid.size,
        n_levels: pyramid.levels.len(),
        cell_m: f64::from(cell_mm) / 1000.0,
    };
    for ((name, _), store) in images.iter().zip(&stores) {
        store.write(&out.join(name), &grid, frame)?;
    }
    Ok(images.into_iter().map(|(name, _)| name).collect())
}

/// Offsets in a record of the fields that rasters need. `None` if records do not have the field.
#[derive(Clone, Copy)]
struct FieldOffsets {
    class: Option<usize>,
    moving: Option<usize>,
    camera: Option<usize>,
}

/// Converts the points of tiles to cells.
struct CellReader<'a> {
    points: &'a Spool<Tile>,
    fields: FieldOffsets,
    /// Coordinates that are stored as 0, mm.
    origin: [i64; 2],
    cell: i64,
    record_bytes: usize,
    has_several_runs: bool,
}

impl CellReader<'_> {
    fn read(&self, tile: Tile) -> Result<Cells, DeliverError> {
        let mut cells = Cells::builder();
        let FieldOffsets { class, moving, camera } = self.fields;
        let value = |record: &[u8], at: Option<usize>, absent: u8| at.map_or(absent, |at| record[at]);
        self.points.each_piece(&tile, POINTS_AT_A_TIME, |records| {
            for record in records.chunks_exact(self.record_bytes) {
                if value(record, moving, 0) != 0 {
                    continue;
                }
                let [x, y, z] = position_of(record);
                let column = (i64::from(x) + self.origin[0]).div_euclid(self.cell) - tile.0 * TILE as i64;
                let row = (i64::from(y) + self.origin[1]).div_euclid(self.cell) - tile.1 * TILE as i64;
                // Image rows increase to the south.
                let idx = (TILE - 1 - row as usize) * TILE + column as usize;
                let is_colored = value(record, camera, messages::UNSEEN) != messages::UNSEEN;
                let class = value(record, class, 0);
                cells.add(idx, z, class, is_colored.then_some(color_of(record)));
                if self.has_several_runs {
                    cells.add_to_difference(idx, z, class, source_of(record));
                }
            }
            Ok(())
        })?;
        Ok(cells.finish())
    }
}

/// Tiles of all levels: full resolution, then overviews with half the resolution of the previous level.
struct Pyramid {
    /// The lowest tile of each level with points, and the number of tiles at full resolution.
    low: Tile,
    size: [usize; 2],
    levels: Vec<BTreeSet<Tile>>,
}

impl Pyramid {
    /// `None` without tiles.
    fn new(tiles: &BTreeSet<Tile>) -> Option<Self> {
        let columns = || tiles.iter().map(|tile| tile.0);
        let rows = || tiles.iter().map(|tile| tile.1);
        let low = (columns().min()?, rows().max()?);
        let high = (columns().max()?, rows().min()?);
        let size = [high.0 - low.0 + 1, low.1 - high.1 + 1].map(|n| n as usize);
        // Numbers counted from the upper left corner.
        let first = tiles.iter().map(|tile| (tile.0 - low.0, low.1 - tile.1)).collect();
        let mut levels: Vec<BTreeSet<Tile>> = vec![first];
        while size.iter().any(|n| n.div_ceil(1 << (levels.len() - 1)) > 1) {
            let above = levels[levels.len() - 1].iter().map(|tile| (tile.0 / 2, tile.1 / 2)).collect();
            levels.push(above);
        }
        Some(Self { low, size, levels })
    }

    /// Cells of a tile. The tile and the tiles below it are added to the images. Tile (0, 0) of the last level covers
    /// everything.
    fn build(
        &self,
        level: usize,
        tile: Tile,
        reader: &CellReader<'_>,
        images: &[ImageTiles<'_>],
    ) -> Result<Option<Cells>, DeliverError> {
        if !self.levels[level].contains(&tile) {
            return Ok(None);
        }
        let cells = if level == 0 {
            reader.read((self.low.0 + tile.0, self.low.1 - tile.1))?
        } else {
            let below = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| (tile.0 * 2 + i, tile.1 * 2 + j));
            let quarters: Result<Vec<Option<Cells>>, DeliverError> =
                below.par_iter().map(|tile| self.build(level - 1, *tile, reader, images)).collect();
            Cells::joined(&quarters?)
        };
        images.iter().try_for_each(|image| image.add(level, tile, &cells))?;
        Ok(Some(cells))
    }
}

impl CloudDelivery<'_> {
    fn extra_offsets(&self) -> FieldOffsets {
        let offset = |name: &str| self.layout.extra.offset(name).map(|at| FORMAT_7_BYTES + at);
        FieldOffsets { class: offset("class"), moving: offset("moving"), camera: offset("camera") }
    }
}
