//! Square tiles of points.

use crate::cloud_delivery::{CloudDelivery, CloudOptions, LeftOut, metres};
use crate::error::DeliverError;
use crate::las::{Extent, LasFile};
use crate::run_folder::RunFolder;
use crate::target_frame::TargetFrame;
use rayon::prelude::*;
use serde::Serialize;
use std::path::Path;

/// Points of one file that are compressed in parallel, in chunks of 50 000.
const POINTS_AT_A_TIME: usize = 200_000;
/// Stored coordinate steps per metre.
const STEPS_PER_M: i64 = 1000;

/// Division of points into files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tiling {
    /// Side of a tile, m. 0 = one file.
    pub side_m: u32,
    /// LAZ, or LAS without compression.
    pub is_compressed: bool,
}

/// A written file of points.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PointFile {
    /// Path relative to the folder of the delivery.
    pub file: String,
    /// Number of points.
    pub n_points: u64,
    /// Smallest and largest coordinates, m.
    pub bounds: [[f64; 3]; 2],
}

/// Writes the points of a run as tiles into the existing folder `out`. A point on an edge belongs to the tile to the
/// right or above, so each point is in exactly one tile. `progress` receives numbers of points read, then numbers of
/// points written.
pub fn write_tiles(
    run: &RunFolder,
    frame: &TargetFrame<'_>,
    (options, tiling): (&CloudOptions, Tiling),
    out: &Path,
    mut progress: impl FnMut(u64),
) -> Result<(Vec<PointFile>, LeftOut), DeliverError> {
    let mut delivery = CloudDelivery::new(run, frame, options)?;
    let [x0, y0, _] = delivery.facts.offset_m.map(|offset| offset as i64 * STEPS_PER_M);
    let side = i64::from(tiling.side_m) * STEPS_PER_M;
    let tile_of = move |[x, y, _]: [i32; 3]| {
        let number = |stored: i32, offset: i64| (i64::from(stored) + offset).checked_div_euclid(side).unwrap_or(0);
        (number(x, x0), number(y, y0))
    };
    let spool = delivery.spool(out, tile_of, &mut progress)?;
    let name = |(column, row): (i64, i64)| {
        let extension = if tiling.is_compressed { "laz" } else { "las" };
        match i64::from(tiling.side_m) {
            0 => format!("points.{extension}"),
            side => format!("{}_{}.{extension}", column * side, row * side),
        }
    };
    let tiles = spool.keys();
    let mut files = Vec::new();
    // As many tiles at a time as there are threads, so that progress is reported in between.
    for tiles in tiles.chunks(rayon::current_num_threads()) {
        let written: Result<Vec<PointFile>, DeliverError> = tiles
            .par_iter()
            .map(|(tile, _)| {
                let file = name(*tile);
                let mut las = LasFile::create(&out.join(&file), &delivery.facts, &delivery.vlrs, tiling.is_compressed)?;
                spool.each_piece(tile, POINTS_AT_A_TIME, |records| las.write(records))?;
                let Extent { n_points, bounds } = las.finish()?;
                Ok(PointFile { file, n_points, bounds: bounds.map(|corner| metres(corner, delivery.facts.offset_m)) })
            })
            .collect();
        files.extend(written?);
        progress(tiles.iter().map(|(_, n_points)| n_points).sum());
    }
    Ok((files, delivery.left_out))
}
