//! The points of the clouds of a run, read in blocks.

mod columns;
mod spectra;

pub(crate) use columns::{Columns, ScanLine, extra_fields};
pub(crate) use spectra::{Spectra, band_names};

use crate::error::DeliverError;
use crate::run_folder::RunFolder;
use delivery::CloudEntry;
use formats::ply::PlyRows;
use messages::columns::Column;
use std::collections::BTreeSet;

/// Points of a block: 16 MB of rows.
pub(crate) const BLOCK_POINTS: usize = 1 << 18;

/// One point of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudPoint {
    /// Coordinates in the frame of the clouds, m.
    pub xyz: [f64; 3],
    /// Position of the LiDAR at the shot, m.
    pub lidar_xyz: [f64; 3],
    /// Seconds since the Unix epoch.
    pub time_s: f64,
    /// Number of the sweep.
    pub frame: u32,
    /// Intensity as the device reports it.
    pub intensity: u8,
    /// Number of the laser.
    pub ring: u8,
    /// Whether the point is on a moving object.
    pub is_moving: bool,
    /// Index of the LiDAR.
    pub lidar: u8,
    /// Instance number; 0 = no instance.
    pub instance: u32,
    /// Class id; 0 without classes.
    pub class: u8,
    /// sRGB; black without color.
    pub rgb: [u8; 3],
}

/// Columns of a cloud, or of at least one cloud of a run.
#[derive(Clone, Debug)]
pub(crate) struct Present {
    table: &'static [Column],
    names: BTreeSet<&'static str>,
}

impl Present {
    pub(crate) fn new(table: &'static [Column], names: impl IntoIterator<Item = &'static str>) -> Self {
        Self { table, names: names.into_iter().collect() }
    }

    /// All columns that may be present.
    pub(crate) fn table(&self) -> &'static [Column] {
        self.table
    }

    /// Whether a column of this name is present.
    pub(crate) fn has(&self, column: &str) -> bool {
        self.names.contains(column)
    }
}

/// An open cloud.
pub(crate) struct Cloud<'a> {
    /// Its run.
    pub(crate) run: &'a RunFolder,
    /// Its entry in the index.
    pub(crate) entry: &'a CloudEntry,
    rows: PlyRows,
    pub(crate) columns: Columns,
}

impl<'a> Cloud<'a> {
    /// Opens a cloud. `None` if it is not in the frame of the run: in a live run, a cloud that was not placed stays in
    /// the odometry frame.
    pub(crate) fn open(run: &'a RunFolder, entry: &'a CloudEntry) -> Result<Option<Self>, DeliverError> {
        if run.georeference.is_some() && !entry.is_placed() {
            return Ok(None);
        }
        let path = run.cloud(entry);
        let rows = PlyRows::open(&path)?;
        let columns =
            Columns::from_header(rows.header(), run.columns).map_err(|rule| DeliverError::content(&path, rule))?;
        let columns = columns.corrected(run.correction(entry.seq));
        Ok(Some(Self { run, entry, rows, columns }))
    }

    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Passes the rows of each block, and the number of its first point, to `take`.
    pub(crate) fn each_block(
        &self,
        mut take: impl FnMut(usize, &[u8]) -> Result<(), DeliverError>,
    ) -> Result<(), DeliverError> {
        let row_size = self.rows.header().row_size();
        let mut block = Vec::new();
        for first in (0..self.len()).step_by(BLOCK_POINTS) {
            block.resize(BLOCK_POINTS.min(self.len() - first) * row_size, 0);
            self.rows.read_into(first, &mut block)?;
            take(first, &block)?;
        }
        Ok(())
    }
}

/// The clouds of runs.
pub(crate) struct OpenedClouds<'a> {
    /// All clouds that are in the frame of their run.
    pub clouds: Vec<Cloud<'a>>,
    /// Number of points of the other clouds.
    pub n_left_out: u64,
}

/// Opens all clouds of runs, run by run.
pub(crate) fn open_all(runs: &[RunFolder]) -> Result<OpenedClouds<'_>, DeliverError> {
    let mut clouds = Vec::new();
    let mut n_left_out = 0;
    for run in runs {
        for entry in &run.index.clouds {
            match Cloud::open(run, entry)? {
                Some(cloud) => clouds.push(cloud),
                None => n_left_out += entry.n_points,
            }
        }
    }
    Ok(OpenedClouds { clouds, n_left_out })
}

/// The columns that at least one of the clouds has.
pub(crate) fn present(table: &'static [Column], clouds: &[Cloud<'_>]) -> Present {
    Present::new(table, clouds.iter().flat_map(|cloud| cloud.columns.present().names))
}
