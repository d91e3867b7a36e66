//! Points and ground of a tile as cells.

use super::Tile;
use super::cells::{CellGround, CellPoint, Cells, NO_HEIGHT, TILE};
use super::content::{COMPLETED, MEASURED};
use super::nodes::Nodes;
use crate::cloud_delivery::CloudDelivery;
use crate::error::DeliverError;
use crate::las::{FORMAT_7_BYTES, color_of, is_withheld, position_of, source_of};
use crate::spool::Spool;
use crate::static_world::{GroundSample, StaticWorld};
use crate::target_frame::TargetFrame;
use serde::Serialize;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Number of points read at a time.
const POINTS_AT_A_TIME: usize = 1 << 18;
/// Bytes of a record of the ground: coordinates of 4 bytes each, sRGB, flags.
const GROUND_BYTES: usize = 16;
/// Flag of ground with a color.
const IS_COLORED: u8 = 1;

/// Numbers of cells by their source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CellCounts {
    /// Cells of the terrain that were measured.
    pub terrain_measured: u64,
    /// Cells of the terrain that were completed.
    pub terrain_completed: u64,
    /// Cells of the orthophoto whose color was measured.
    pub orthophoto_measured: u64,
    /// Cells of the orthophoto whose color was completed.
    pub orthophoto_completed: u64,
}

/// Offsets in a record of the fields that rasters need. `None` if records do not have the field.
#[derive(Clone, Copy)]
pub(super) struct FieldOffsets {
    pub(super) class: Option<usize>,
    moving: Option<usize>,
    pub(super) camera: Option<usize>,
}

impl FieldOffsets {
    pub(super) fn new(delivery: &CloudDelivery<'_>) -> Self {
        let offset = |name: &str| delivery.layout.extra.offset(name).map(|at| FORMAT_7_BYTES + at);
        Self { class: offset("class"), moving: offset("moving"), camera: offset("camera") }
    }
}

/// The lattice of the cells in stored coordinates.
#[derive(Clone, Copy)]
pub(super) struct Lattice {
    /// Coordinates that are stored as 0, mm.
    pub(super) origin: [i64; 2],
    /// Side of a cell, mm.
    pub(super) cell: i64,
}

impl Lattice {
    /// The tile of a place.
    pub(super) fn tile(&self, [x, y, _]: [i32; 3]) -> Tile {
        let side = self.cell * TILE as i64;
        ((i64::from(x) + self.origin[0]).div_euclid(side), (i64::from(y) + self.origin[1]).div_euclid(side))
    }

    /// Index of the cell in its tile. Rows of images increase to the south.
    fn idx(&self, tile: Tile, [x, y, _]: [i32; 3]) -> usize {
        let column = (i64::from(x) + self.origin[0]).div_euclid(self.cell) - tile.0 * TILE as i64;
        let row = (i64::from(y) + self.origin[1]).div_euclid(self.cell) - tile.1 * TILE as i64;
        (TILE - 1 - row as usize) * TILE + column as usize
    }

    fn cell_m2(&self) -> f64 {
        (self.cell as f64 / 1000.0).powi(2)
    }

    /// Distance of samples of the ground with which every cell has one, however the axes are rotated, m.
    fn spacing_m(&self) -> f64 {
        self.cell as f64 / 1000.0 * std::f64::consts::FRAC_1_SQRT_2
    }
}

/// The ground that the caller has determined, by tile.
pub(super) fn spool_ground(
    world: &dyn StaticWorld,
    frame: &TargetFrame<'_>,
    delivery: &CloudDelivery<'_>,
    lattice: Lattice,
    folder: &Path,
) -> Result<Spool<Tile>, DeliverError> {
    let mut spool = Spool::create(folder, GROUND_BYTES)?;
    let mut converter = frame.converter();
    let mut records = Vec::new();
    let mut keys = Vec::new();
    world.each_ground(lattice.spacing_m(), &mut |samples| {
        records.clear();
        keys.clear();
        for GroundSample { xyz, rgb } in samples {
            let Some(stored) = delivery.layout.stored(converter.convert(*xyz)?) else { continue };
            records.extend(stored.iter().flat_map(|value| value.to_le_bytes()));
            records.extend(rgb.unwrap_or_default());
            records.push(u8::from(rgb.is_some()) * IS_COLORED);
            keys.push(lattice.tile(stored));
        }
        spool.add(&records, &keys)
    })?;
    Ok(spool)
}

/// Converts the points of tiles to cells.
pub(super) struct CellReader<'a> {
    pub(super) points: &'a Spool<Tile>,
    pub(super) ground: Option<&'a Spool<Tile>>,
    pub(super) fields: FieldOffsets,
    pub(super) lattice: Lattice,
    pub(super) record_bytes: usize,
    pub(super) has_several_runs: bool,
    pub(super) counts: Mutex<CellCounts>,
    /// Heights for contour lines.
    pub(super) nodes: Option<Mutex<Nodes>>,
}

impl CellReader<'_> {
    pub(super) fn read(&self, tile: Tile) -> Result<Cells, DeliverError> {
        let mut cells = Cells::builder();
        let FieldOffsets { class, moving, camera } = self.fields;
        let value = |record: &[u8], at: Option<usize>, absent: u8| at.map_or(absent, |at| record[at]);
        self.points.each_piece(&tile, POINTS_AT_A_TIME, |records| {
            for record in records.chunks_exact(self.record_bytes) {
                if value(record, moving, 0) != 0 {
                    continue;
                }
                let place = position_of(record);
                let idx = self.lattice.idx(tile, place);
                let is_colored = value(record, camera, messages::UNSEEN) != messages::UNSEEN;
                let class = value(record, class, 0);
                let rgb = is_colored.then(|| color_of(record));
                cells.add(idx, CellPoint { z_mm: place[2], class, rgb, is_removed: is_withheld(record) });
                if self.has_several_runs {
                    cells.add_to_difference(idx, place[2], class, source_of(record));
                }
            }
            Ok(())
        })?;
        if let Some(ground) = self.ground {
            ground.each_piece(&tile, POINTS_AT_A_TIME, |records| {
                for record in records.chunks_exact(GROUND_BYTES) {
                    let place = position_of(record);
                    let rgb =
                        (record[GROUND_BYTES - 1] & IS_COLORED != 0).then(|| [record[12], record[13], record[14]]);
                    cells.add_surface(self.lattice.idx(tile, place), CellGround { z_mm: place[2], rgb });
                }
                Ok(())
            })?;
        }
        let cells = cells.finish(self.lattice.cell_m2());
        self.count(&cells);
        if let Some(nodes) = &self.nodes {
            nodes.lock().unwrap_or_else(PoisonError::into_inner).add(tile, &cells.terrain, NO_HEIGHT);
        }
        Ok(cells)
    }

    fn count(&self, cells: &Cells) {
        let n = |values: &[u8], wanted: u8| values.iter().map(|value| u64::from(*value == wanted)).sum::<u64>();
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        counts.terrain_measured += n(&cells.terrain_source, MEASURED);
        counts.terrain_completed += n(&cells.terrain_source, COMPLETED);
        counts.orthophoto_measured += n(&cells.orthophoto_source, MEASURED);
        counts.orthophoto_completed += n(&cells.orthophoto_source, COMPLETED);
    }
}
