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

/// Names of tiles, without extension. Sorted names are sorted by easting, then northing.
struct TileNames {
    /// Side of a tile, m; 0 = one file.
    side: i64,
    /// Smallest column and row.
    first: (i64, i64),
    /// Least number of digits of both numbers.
    digits: (usize, usize),
}

/// Digits of the easting and northing of UTM.
const UTM_DIGITS: (usize, usize) = (6, 7);
/// Least number of digits of a column or row.
const INDEX_DIGITS: usize = 4;

impl TileNames {
    fn new(tiles: impl Iterator<Item = (i64, i64)> + Clone, side: i64) -> Self {
        let least = |axis: fn((i64, i64)) -> i64| tiles.clone().map(axis).min().unwrap_or(0);
        let most = |axis: fn((i64, i64)) -> i64| tiles.clone().map(axis).max().unwrap_or(0);
        let first = (least(|tile| tile.0), least(|tile| tile.1));
        let last = (most(|tile| tile.0), most(|tile| tile.1));
        let n_digits = |number: i64| number.to_string().len();
        let digits = if first.0 < 0 || first.1 < 0 {
            (n_digits(last.0 - first.0).max(INDEX_DIGITS), n_digits(last.1 - first.1).max(INDEX_DIGITS))
        } else {
            (n_digits(last.0 * side).max(UTM_DIGITS.0), n_digits(last.1 * side).max(UTM_DIGITS.1))
        };
        Self { side, first, digits }
    }

    /// The lower left corner in m. If the delivery has negative coordinates, column and row, counted from its lower left: a name
    /// with a minus would be read as an option, and would not sort.
    fn name(&self, (column, row): (i64, i64)) -> String {
        let Self { side, first, digits: (x_digits, y_digits) } = *self;
        if side == 0 {
            "points".to_owned()
        } else if first.0 < 0 || first.1 < 0 {
            format!("column{:0x_digits$}_row{:0y_digits$}", column - first.0, row - first.1)
        } else {
            format!("{:0x_digits$}_{:0y_digits$}", column * side, row * side)
        }
    }
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
    let tiles = spool.keys();
    let names = TileNames::new(tiles.iter().map(|(tile, _)| *tile), i64::from(tiling.side_m));
    let extension = if tiling.is_compressed { "laz" } else { "las" };
    let name = |tile| format!("{}.{extension}", names.name(tile));
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_tiles_sort_and_have_no_minus() {
        for (tiles, side, expected) in [
            (&[(9043, 108_214), (9043, 108_215)][..], 50, &["452150_5410700", "452150_5410750"][..]),
            // Lambert-93 in Alsace, UTM at the equator.
            (&[(19_999, 137_000), (20_000, 137_000)], 50, &["0999950_6850000", "1000000_6850000"]),
            (&[(3320, 0), (3320, 1)], 50, &["166000_0000000", "166000_0000050"]),
            (
                &[(-2, 0), (-1, 0), (0, 0), (9, 0)],
                50,
                &["column0000_row0000", "column0001_row0000", "column0002_row0000", "column0011_row0000"],
            ),
            (&[(5, -1), (5, 0)], 50, &["column0000_row0000", "column0000_row0001"]),
            (&[(0, 0)], 0, &["points"]),
        ] {
            let names = TileNames::new(tiles.iter().copied(), side);
            let found: Vec<String> = tiles.iter().map(|tile| names.name(*tile)).collect();
            assert_eq!(found, expected);
            assert!(found.is_sorted(), "{found:?}");
        }
    }
}
