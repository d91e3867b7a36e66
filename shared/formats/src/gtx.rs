//! Grids of heights in the GTX format of NOAA: the height of a geoid above the ellipsoid, for orthometric heights.
//!
//! Big-endian: `f64` latitude and longitude of the lower left node and the steps of both, degrees; `i32` rows and columns; then `f32`
//! values, m, in rows from south to north. -88.8888 marks nodes without value.

use files::regular_file;
use std::io;
use std::path::{Path, PathBuf};

/// Bytes before the values.
const HEADER_BYTES: usize = 40;
/// Nodes without value.
const NO_VALUE: f32 = -88.8888;

/// Heights of a geoid above the ellipsoid.
#[derive(Clone, Debug)]
pub struct GeoidGrid {
    /// Latitude and longitude of the lower left node, degrees.
    first_deg: [f64; 2],
    /// Steps, degrees.
    step_deg: [f64; 2],
    n_rows: usize,
    n_cols: usize,
    values: Vec<f32>,
}

/// Error of a file that is not a GTX grid.
#[derive(Debug, thiserror::Error)]
pub enum GtxError {
    /// The file cannot be read.
    #[error("{}: cannot read: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The content does not have the format.
    #[error("{}: is not a GTX grid: {rule}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The value found and the rule.
        rule: String,
    },
}

impl GeoidGrid {
    /// Reads a file.
    pub fn load(path: &Path) -> Result<Self, GtxError> {
        let bytes = regular_file::read(path).map_err(|source| GtxError::File { path: path.to_owned(), source })?;
        Self::decode(&bytes).map_err(|rule| GtxError::Content { path: path.to_owned(), rule })
    }

    /// Decodes the content of a file. The error is the rule that it breaks.
    pub fn decode(bytes: &[u8]) -> Result<Self, String> {
        let Some((header, values)) = bytes.split_at_checked(HEADER_BYTES) else {
            return Err(format!("{} bytes, the header has {HEADER_BYTES}", bytes.len()));
        };
        let (doubles, sizes) = header.split_at(32);
        let [lat, lon, lat_step, lon_step] = std::array::from_fn(|k| f64::from_be_bytes(doubles.as_chunks().0[k]));
        let [n_rows, n_cols] = std::array::from_fn(|k| i32::from_be_bytes(sizes.as_chunks().0[k]));
        let is_sound = [lat, lon].iter().all(|value| value.abs() <= 360.0)
            && [lat_step, lon_step].iter().all(|step| *step > 0.0 && *step <= 90.0);
        if !is_sound {
            return Err(format!("begins at {lat} {lon} with steps of {lat_step} {lon_step} degrees"));
        }
        let n_bytes = i64::from(n_rows) * i64::from(n_cols) * 4;
        if n_rows < 2 || n_cols < 2 || n_bytes != values.len() as i64 {
            return Err(format!("{n_rows} rows of {n_cols} columns in {} bytes", values.len()));
        }
        Ok(Self {
            first_deg: [lat, lon],
            step_deg: [lat_step, lon_step],
            n_rows: n_rows as usize,
            n_cols: n_cols as usize,
            values: values.as_chunks().0.iter().map(|bytes| f32::from_be_bytes(*bytes)).collect(),
        })
    }

    /// Height of the geoid above the ellipsoid, m, bilinear between the nodes. `None` outside the grid and in cells that
    /// have a node without value.
    pub fn height(&self, latitude_deg: f64, longitude_deg: f64) -> Option<f64> {
        let row = (latitude_deg - self.first_deg[0]) / self.step_deg[0];
        // Grids count from -180 or from 0 degrees.
        let turn = 360.0 / self.step_deg[1];
        let col = ((longitude_deg - self.first_deg[1]) / self.step_deg[1]).rem_euclid(turn);
        let is_global = (self.n_cols as f64 - turn).abs() < 1e-6;
        let low = row.floor();
        let left = col.floor();
        if !(0.0..=(self.n_rows - 1) as f64).contains(&row) || !is_global && col > (self.n_cols - 1) as f64 {
            return None;
        }
        // The last row and column belong to the cell before them.
        let low = low.min((self.n_rows - 2) as f64);
        let left = if is_global { left } else { left.min((self.n_cols - 2) as f64) };
        let value = |row: usize, col: usize| {
            let value = self.values[row * self.n_cols + col % self.n_cols];
            (value.is_finite() && (value - NO_VALUE).abs() > 1e-3).then_some(f64::from(value))
        };
        let up = row - low;
        let right = col - left;
        let i = low as usize;
        let j = left as usize;
        let below = value(i, j)? * (1.0 - right) + value(i, j + 1)? * right;
        let above = value(i + 1, j)? * (1.0 - right) + value(i + 1, j + 1)? * right;
        Some(below * (1.0 - up) + above * up)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(first_deg: [f64; 2], step_deg: [f64; 2], n_rows: i32, values: &[f32]) -> Vec<u8> {
        let doubles = first_deg.into_iter().chain(step_deg).flat_map(f64::to_be_bytes);
        let sizes = [n_rows, values.len() as i32 / n_rows].into_iter().flat_map(i32::to_be_bytes);
        doubles.chain(sizes).chain(values.iter().flat_map(|value| value.to_be_bytes())).collect()
    }

    #[test]
    fn heights_are_bilinear_and_absent_outside() {
        let bytes = grid([48.0, 2.0], [0.5, 1.0], 3, &[40.0, 42.0, 44.0, 46.0, 48.0, -88.8888]);
        let geoid = GeoidGrid::decode(&bytes).expect("is a grid");
        assert_eq!(geoid.height(48.0, 2.0), Some(40.0));
        assert_eq!(geoid.height(48.25, 2.5), Some(43.0));
        assert_eq!(geoid.height(48.0, 3.0), Some(42.0), "the last column belongs to the grid");
        for (latitude, longitude) in [(47.9, 2.5), (48.2, 3.1), (48.2, 1.9), (48.9, 2.9)] {
            assert_eq!(geoid.height(latitude, longitude), None, "{latitude} {longitude}");
        }
    }

    #[test]
    fn longitudes_of_global_grid_wrap_around() {
        let bytes = grid([-90.0, 0.0], [90.0, 90.0], 3, &[0.0; 12]);
        let mut geoid = GeoidGrid::decode(&bytes).expect("is a grid");
        geoid.values[4..8].copy_from_slice(&[10.0, 20.0, 30.0, 40.0]);
        assert_eq!(geoid.height(0.0, -90.0), Some(40.0));
        assert_eq!(geoid.height(0.0, -45.0), Some(25.0), "between the last and the first column");
    }

    #[test]
    fn other_files_are_refused() {
        for (bytes, rule) in [
            (vec![0; 12], "12 bytes, the header has 40"),
            (grid([48.0, 2.0], [0.0, 1.0], 2, &[0.0; 4]), "steps of 0 1 degrees"),
            (grid([48.0, 2.0], [1.0, 1.0], 2, &[0.0; 4])[..44].to_vec(), "2 rows of 2 columns in 4 bytes"),
        ] {
            let error = GeoidGrid::decode(&bytes).expect_err("is refused");
            assert!(error.contains(rule), "{error}");
        }
    }
}
