//! Top-down pictures of a column of clouds: one pixel for each cell, north up.

use super::cloud_summary::{CloudSummary, percentiles};
use super::palette::{ramp, share};
use super::settings::Background;
use anyhow::Context;
use formats::ply::Vertices;
use geometry::{BevGrid, BevStatistic, BevValues};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Default side of a cell, m, as in the thesis' instance detection.
const DEFAULT_CELL_M: f64 = 0.1;

/// Largest number of cells: 512 MiB of values, 400 m x 400 m in cells of 0.1 m.
const MAX_CELLS: usize = 1 << 24;

/// What `--bev` requests.
#[derive(Clone, Debug, PartialEq)]
pub struct BevRequest {
    /// Column of the PLY files.
    pub feature: String,
    /// Statistic of the points of a cell.
    pub statistic: BevStatistic,
    /// Side of a cell, 0.01 to 100 m.
    pub cell_m: f64,
}

#[derive(Debug, thiserror::Error)]
pub enum InvalidBev {
    #[error("must be FEATURE:STATISTIC[:CELL_M], such as z:max or intensity:mean:0.2")]
    Form,
    #[error("statistic {0:?}: must be max, min, difference, accumulation or mean")]
    Statistic(String),
    #[error("cells of {0:?} m: must be 0.01 to 100")]
    Cell(String),
}

/// The words of the option.
const STATISTICS: [(&str, BevStatistic); 5] = [
    ("max", BevStatistic::Max),
    ("min", BevStatistic::Min),
    ("difference", BevStatistic::Difference),
    ("accumulation", BevStatistic::Accumulation),
    ("mean", BevStatistic::Mean),
];

impl FromStr for BevRequest {
    type Err = InvalidBev;

    fn from_str(text: &str) -> Result<Self, InvalidBev> {
        let words: Vec<&str> = text.split(':').collect();
        let (feature, statistic, cell) = match words.as_slice() {
            [feature, statistic] => (*feature, *statistic, None),
            [feature, statistic, cell] => (*feature, *statistic, Some(*cell)),
            _ => return Err(InvalidBev::Form),
        };
        if feature.is_empty() {
            return Err(InvalidBev::Form);
        }
        let found = STATISTICS.iter().find(|(name, _)| *name == statistic);
        let (_, statistic) = *found.ok_or_else(|| InvalidBev::Statistic(statistic.to_owned()))?;
        let number = |cell: &str| cell.parse().ok().filter(|cell_m| (0.01..=100.0).contains(cell_m));
        let cell_m = match cell {
            Some(cell) => number(cell).ok_or_else(|| InvalidBev::Cell(cell.to_owned()))?,
            None => DEFAULT_CELL_M,
        };
        Ok(Self { feature: feature.to_owned(), statistic, cell_m })
    }
}

/// Renders a column of these files, which `summary` describes, into a PNG. Returns a line about the image.
pub fn render_bev(
    files: &[PathBuf],
    summary: &CloudSummary,
    request: &BevRequest,
    background: Background,
    picture: &Path,
) -> anyhow::Result<String> {
    let [min, max] = summary.bounds().context("no points to render")?;
    let corner = |p: [f64; 3]| [p[0], p[1]];
    let grid = BevGrid::covering(corner(min), corner(max), request.cell_m, MAX_CELLS).with_context(|| {
        let [width_m, depth_m] = [max[0] - min[0], max[1] - min[1]];
        format!(
            "{width_m:.1} x {depth_m:.1} m in cells of {} m need more than {MAX_CELLS} cells; choose larger cells: --bev {}:...:{}",
            request.cell_m,
            request.feature,
            request.cell_m * 2.0
        )
    })?;
    let mut values = BevValues::new(grid);
    let mut n_ignored = 0_u64;
    for file in files {
        let vertices = Vertices::load(file)?;
        let x = vertices.f64s("x")?;
        let y = vertices.f64s("y")?;
        let feature = vertices.f64s(&request.feature)?;
        for ((x, y), value) in x.iter().zip(&y).zip(&feature) {
            n_ignored += u64::from(!values.add(*x, *y, *value));
        }
    }
    let image = values.image(request.statistic);
    let range = percentiles(&image.iter().copied().flatten().collect::<Vec<_>>());
    let grid = values.grid();
    let width = grid.rows;
    let height = grid.cols;
    let mut pixels = Vec::with_capacity(width * height * 3);
    // Rows of the grid follow x, its columns y; the picture has x to the right and y up.
    for col in (0..grid.cols).rev() {
        for row in 0..grid.rows {
            let empty = match background {
                Background::Dark => [0, 0, 0],
                Background::White => [255, 255, 255],
            };
            pixels.extend(image[row * grid.cols + col].map_or(empty, |value| ramp(share(value, range))));
        }
    }
    image::save_buffer_with_format(
        picture,
        &pixels,
        width as u32,
        height as u32,
        image::ColorType::Rgb8,
        image::ImageFormat::Png,
    )
    .with_context(|| format!("{}: cannot write the picture", picture.display()))?;
    eprintln!("wrote {}", picture.display());
    let n_occupied = image.iter().flatten().count();
    let name = STATISTICS.iter().find(|(_, statistic)| *statistic == request.statistic).map_or("", |(name, _)| name);
    Ok(format!(
        "bev {} {}: {width} x {height} cells of {} m, {n_occupied} with points, colors from {:.3} to {:.3}, {n_ignored} points without a \
         finite value\n",
        request.feature, name, request.cell_m, range[0], range[1]
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bev_request_is_parsed_and_errors_name_the_rule() {
        let request = |feature: &str, statistic, cell_m| BevRequest { feature: feature.to_owned(), statistic, cell_m };
        assert_eq!("z:max".parse::<BevRequest>().expect("valid"), request("z", BevStatistic::Max, 0.1));
        let with_cell = "intensity:mean:0.25".parse::<BevRequest>().expect("valid");
        assert_eq!(with_cell, request("intensity", BevStatistic::Mean, 0.25));
        for (text, rule) in [
            ("z", "FEATURE:STATISTIC[:CELL_M]"),
            (":max", "FEATURE:STATISTIC[:CELL_M]"),
            ("z:max:1:2", "FEATURE:STATISTIC[:CELL_M]"),
            ("z:median", "must be max, min, difference, accumulation or mean"),
            ("z:max:0", "must be 0.01 to 100"),
            ("z:max:NaN", "must be 0.01 to 100"),
        ] {
            let error = text.parse::<BevRequest>().expect_err("is invalid").to_string();
            assert!(error.contains(rule), "{text}: {error}");
        }
    }
}
