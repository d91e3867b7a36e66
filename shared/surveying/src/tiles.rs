//! Square tiles of points.

use crate::cloud_delivery::{CloudDelivery, CloudOptions, LeftOut, metres};
use crate::error::DeliverError;
use crate::features::{rectangle_feature, write_features};
use crate::geojson::rounded;
use crate::las::{Extent, LasFile};
use crate::run_folder::RunFolder;
use crate::spool::KeyedRecords;
use crate::target_frame::TargetFrame;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::json;
use std::path::Path;

/// Points of one file that are compressed in parallel, in chunks of 50 000.
const POINTS_AT_A_TIME: usize = 200_000;
/// Stored coordinate steps per metre.
const STEPS_PER_M: i64 = 1000;

/// Name of the file with the squares of the tiles.
pub const TILE_INDEX: &str = "tiles.geojson";

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

/// The tiles of a run.
#[derive(Clone, Debug)]
pub struct WrittenTiles {
    /// Their files.
    pub files: Vec<PointFile>,
    /// Points in no file.
    pub left_out: LeftOut,
}

/// Names of tiles, without extension. Sorted names are sorted by easting, then northing.
struct TileNames {
    /// Side of a tile, m; 0 = one file.
    side: i64,
    /// Smallest column.
    first_column: i64,
    /// Smallest row.
    first_row: i64,
    /// Least number of digits of a column or easting.
    x_digits: usize,
    /// Least number of digits of a row or northing.
    y_digits: usize,
}

/// Digits of the easting of UTM.
const EASTING_DIGITS: usize = 6;
/// Digits of its northing.
const NORTHING_DIGITS: usize = 7;
/// Least number of digits of a column or row.
const INDEX_DIGITS: usize = 4;

impl TileNames {
    fn new(tiles: impl Iterator<Item = (i64, i64)> + Clone, side: i64) -> Self {
        let columns = tiles.clone().map(|(column, _)| column);
        let rows = tiles.map(|(_, row)| row);
        let first_column = columns.clone().min().unwrap_or(0);
        let first_row = rows.clone().min().unwrap_or(0);
        let last_column = columns.max().unwrap_or(0);
        let last_row = rows.max().unwrap_or(0);
        let n_digits = |number: i64| number.to_string().len();
        let is_numbered = first_column < 0 || first_row < 0;
        let x_digits = if is_numbered {
            n_digits(last_column - first_column).max(INDEX_DIGITS)
        } else {
            n_digits(last_column * side).max(EASTING_DIGITS)
        };
        let y_digits = if is_numbered {
            n_digits(last_row - first_row).max(INDEX_DIGITS)
        } else {
            n_digits(last_row * side).max(NORTHING_DIGITS)
        };
        Self { side, first_column, first_row, x_digits, y_digits }
    }

    /// The lower left corner in m. If the delivery has negative coordinates, column and row, counted from its lower left: a name
    /// with a minus would be read as an option, and would not sort.
    fn name(&self, (column, row): (i64, i64)) -> String {
        let Self { side, first_column, first_row, x_digits, y_digits } = *self;
        if side == 0 {
            "points".to_owned()
        } else if first_column < 0 || first_row < 0 {
            format!("column{:0x_digits$}_row{:0y_digits$}", column - first_column, row - first_row)
        } else {
            format!("{:0x_digits$}_{:0y_digits$}", column * side, row * side)
        }
    }
}

/// Writes the points of runs as tiles into the existing folder `out`. A point on an edge belongs to the tile to the
/// right or above, so each point is in exactly one tile. `progress` receives numbers of points read, then numbers of
/// points written.
pub fn write_tiles(
    runs: &[RunFolder],
    frame: &TargetFrame<'_>,
    options: &CloudOptions,
    tiling: Tiling,
    out: &Path,
    mut progress: impl FnMut(u64),
) -> Result<WrittenTiles, DeliverError> {
    let mut delivery = CloudDelivery::new(runs, frame, options)?;
    let [x0, y0, _] = delivery.facts.offset_m.map(|offset| offset as i64 * STEPS_PER_M);
    let side = i64::from(tiling.side_m) * STEPS_PER_M;
    let tile_of = move |[x, y, _]: [i32; 3]| {
        let number = |stored: i32, offset: i64| (i64::from(stored) + offset).checked_div_euclid(side).unwrap_or(0);
        (number(x, x0), number(y, y0))
    };
    let spool = delivery.spool(out, tile_of, &mut progress)?;
    let tiles = spool.keys();
    let names = TileNames::new(tiles.iter().map(|tile| tile.key), i64::from(tiling.side_m));
    let extension = if tiling.is_compressed { "laz" } else { "las" };
    let name = |tile| format!("{}.{extension}", names.name(tile));
    let mut files = Vec::new();
    // As many tiles at a time as there are threads, so that progress is reported in between.
    for tiles in tiles.chunks(rayon::current_num_threads()) {
        let written: Result<Vec<PointFile>, DeliverError> = tiles
            .par_iter()
            .map(|KeyedRecords { key: tile, .. }| {
                let file = name(*tile);
                let mut las = LasFile::create(&out.join(&file), &delivery.facts, &delivery.vlrs, tiling.is_compressed)?;
                spool.each_piece(tile, POINTS_AT_A_TIME, |records| las.write(records))?;
                let Extent { n_points, bounds } = las.finish()?;
                Ok(PointFile { file, n_points, bounds: bounds.map(|corner| metres(corner, delivery.facts.offset_m)) })
            })
            .collect();
        files.extend(written?);
        progress(tiles.iter().map(|tile| tile.n).sum());
    }
    // Readers of GeoJSON take local coordinates for degrees.
    if tiling.side_m > 0 && frame.crs().is_some() {
        write_tile_index(&out.join(TILE_INDEX), frame, tiling.side_m, &tiles, &files)?;
    }
    Ok(WrittenTiles { files, left_out: delivery.left_out })
}

/// Writes the squares of the tiles with the names of their files.
fn write_tile_index(
    path: &Path,
    frame: &TargetFrame<'_>,
    side_m: u32,
    tiles: &[KeyedRecords<(i64, i64)>],
    files: &[PointFile],
) -> Result<(), DeliverError> {
    let feature = |(tile, file): (&KeyedRecords<(i64, i64)>, &PointFile)| {
        let low = [tile.key.0, tile.key.1].map(|number| (number * i64::from(side_m)) as f64);
        let square = [low, low.map(|value| value + f64::from(side_m))];
        let [low_z, high_z] = file.bounds.map(|corner| rounded(corner[2], 1e3));
        let properties = json!({ "file": file.file, "points": file.n_points, "low_m": low_z, "high_m": high_z });
        rectangle_feature(square, &properties)
    };
    write_features(path, frame, &tiles.iter().zip(files).map(feature).collect::<Vec<_>>())
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
