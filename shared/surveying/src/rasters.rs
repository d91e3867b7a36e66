//! Rasters seen from above as Cloud-Optimized GeoTIFF: terrain, height, orthophoto, class, density and others.
//!
//! A tile of the images is also the unit of work: its points come from a temporary file, and each overview tile is
//! computed from the four tiles below it. Memory therefore does not grow with the length of the drive.

mod cells;
mod content;
mod directory;
mod geotiff;
mod nodes;
mod reader;

pub use reader::CellCounts;

pub(crate) use nodes::{Node, Nodes};

use crate::cloud_delivery::{CloudDelivery, CloudOptions};
use crate::error::DeliverError;
use crate::run_folder::RunFolder;
use crate::spool::Spool;
use crate::static_world::StaticWorld;
use crate::target_frame::TargetFrame;
use cells::Cells;
use content::Content;
use geotiff::{Grid, ImageTiles};
use rayon::prelude::*;
use reader::{CellReader, FieldOffsets, Lattice, spool_ground};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Settings of the rasters.
#[derive(Clone, Copy)]
pub struct RasterOptions<'a> {
    /// Side of a cell, mm.
    pub cell_mm: u32,
    /// sRGB by class id.
    pub class_colors: [[u8; 3]; 256],
    /// Completed ground, and the points to leave out. Without it, the terrain has only measured cells, and no orthophoto is written.
    pub world: Option<&'a dyn StaticWorld>,
    /// Whether heights of the ground are kept for contour lines.
    pub keeps_nodes: bool,
}

/// The rasters of runs.
pub struct WrittenRasters {
    /// Names of the files.
    pub files: Vec<&'static str>,
    /// Numbers of cells by their source.
    pub counts: CellCounts,
    /// Heights of the ground for contour lines.
    pub(crate) nodes: Option<Nodes>,
}

/// Column and row of a tile from the origin of the coordinates; rows increase to the north.
type Tile = (i64, i64);

/// Writes rasters into the existing folder `out`: `height.tif` and `density.tif`; if the runs have classes `terrain.tif` and `class.tif`, and
/// for several runs `difference.tif` (differences between runs); if they have colors `color.tif`; with a static world also `orthophoto.tif`
/// and the sources of terrain and orthophoto. Points on moving objects are left out.
pub fn write_rasters(
    runs: &[RunFolder],
    frame: &TargetFrame<'_>,
    options: &CloudOptions,
    rasters: &RasterOptions<'_>,
    out: &Path,
) -> Result<WrittenRasters, DeliverError> {
    let RasterOptions { cell_mm, class_colors, world, keeps_nodes } = rasters;
    let options = CloudOptions { has_bands: false, ..options.clone() };
    let mut delivery = CloudDelivery::new(runs, frame, &options)?;
    delivery.withholds = *world;
    let [x0, y0, _] = delivery.facts.offset_m.map(|offset| offset as i64 * 1000);
    let lattice = Lattice { origin: [x0, y0], cell: i64::from(*cell_mm) };
    let points = delivery.spool(out, |stored| lattice.tile(stored), |_| ())?;
    let fields = FieldOffsets::new(&delivery);
    let world = world.filter(|_| fields.class.is_some());
    let ground = world.map(|world| spool_ground(world, frame, &delivery, lattice, out)).transpose()?;
    let cell_m = f64::from(*cell_mm) / 1000.0;
    let has_terrain = fields.class.is_some();
    let reader = CellReader {
        points: &points,
        ground: ground.as_ref(),
        fields,
        lattice,
        record_bytes: delivery.facts.record_bytes,
        has_several_runs: runs.len() > 1,
        counts: Mutex::default(),
        nodes: (*keeps_nodes && has_terrain).then(|| Mutex::new(Nodes::new(cell_m))),
    };
    let mut images = vec![Content::Height, Content::Density];
    if has_terrain {
        images.extend([Content::Terrain, Content::Class(class_colors)]);
        images.extend(ground.as_ref().map(|_| Content::TerrainSource));
        images.extend((runs.len() > 1).then_some(Content::Difference));
    }
    if fields.camera.is_some() {
        images.push(Content::Color);
        images.extend(ground.iter().flat_map(|_| [Content::Orthophoto, Content::OrthophotoSource]));
    }
    let keys = points.keys().into_iter().chain(ground.iter().flat_map(Spool::keys));
    let tiles: BTreeSet<Tile> = keys.map(|tile| tile.key).collect();
    let mut files = Vec::new();
    if let Some(pyramid) = Pyramid::new(&tiles) {
        let stores = images.iter().map(|content| ImageTiles::create(out, *content));
        let stores: Vec<ImageTiles<'_>> = stores.collect::<Result<_, _>>()?;
        pyramid.build(pyramid.levels.len() - 1, (0, 0), &reader, &stores)?;
        let grid = Grid { low: pyramid.low, size: pyramid.size, n_levels: pyramid.levels.len(), cell_m };
        for (content, store) in images.iter().zip(&stores) {
            store.write(&out.join(content.file_name()), &grid, frame)?;
            files.push(content.file_name());
        }
    }
    let unlocked = PoisonError::into_inner;
    Ok(WrittenRasters {
        files,
        counts: reader.counts.into_inner().unwrap_or_else(unlocked),
        nodes: reader.nodes.map(|nodes| nodes.into_inner().unwrap_or_else(PoisonError::into_inner)),
    })
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
