//! The points of the clouds of a run, block by block.

mod columns;
mod spectra;

pub(crate) use columns::Columns;
pub(crate) use spectra::{Spectra, band_names};

use crate::error::DeliverError;
use crate::run_folder::RunFolder;
use delivery::CloudEntry;
use formats::ply::PlyRows;

/// Points of a block: 16 MB of rows.
pub(crate) const BLOCK_POINTS: usize = 1 << 18;

/// One point of a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudPoint {
    /// Frame of the clouds, m.
    pub xyz: [f64; 3],
    /// The LiDAR at the shot, m.
    pub lidar_xyz: [f64; 3],
    /// Seconds since the Unix epoch.
    pub time_s: f64,
    /// Number of the sweep.
    pub frame: u32,
    /// As the device reports it.
    pub intensity: u8,
    /// Number of the laser.
    pub ring: u8,
    /// Whether it is on a moving object.
    pub is_moving: bool,
    /// Index of the LiDAR.
    pub lidar: u8,
    /// 0 = none.
    pub instance: u32,
    /// Class id; 0 without classes.
    pub class: u8,
    /// Probability of the class in units of 1 / 255.
    pub score: u8,
    /// sRGB; black without color.
    pub rgb: [u8; 3],
    /// 255 = no color.
    pub camera: u8,
    /// Material id; 0 without materials.
    pub material: u8,
    /// Probability of the material in units of 1 / 255.
    pub material_score: u8,
    /// Number of the region; 0 = none.
    pub region: u32,
}

/// Columns that at least one cloud of a run has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "a flag for each column")]
pub struct Present {
    /// Classes with scores.
    pub class: bool,
    /// Instances.
    pub instance: bool,
    /// Colors with cameras.
    pub color: bool,
    /// Several LiDARs.
    pub lidar: bool,
    /// Materials with scores.
    pub material: bool,
    /// Regions of cubes.
    pub region: bool,
}

/// An open cloud.
pub(crate) struct Cloud<'a> {
    /// Its entry in the index.
    pub(crate) entry: &'a CloudEntry,
    rows: PlyRows,
    pub(crate) columns: Columns,
}

impl<'a> Cloud<'a> {
    /// Opens a cloud. `None` if it is not in the frame of the run: live, a cloud without place stays in the frame of the odometry.
    pub(crate) fn open(run: &RunFolder, entry: &'a CloudEntry) -> Result<Option<Self>, DeliverError> {
        if run.georeference.is_some() && !entry.is_placed() {
            return Ok(None);
        }
        let path = run.cloud(entry);
        let rows = PlyRows::open(&path)?;
        let columns = Columns::of(rows.header()).map_err(|rule| DeliverError::content(&path, rule))?;
        Ok(Some(Self { entry, rows, columns }))
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

/// All clouds that are in the frame of the run, and the number of points of the others.
pub(crate) fn open_all(run: &RunFolder) -> Result<(Vec<Cloud<'_>>, u64), DeliverError> {
    let (mut clouds, mut n_left_out) = (Vec::new(), 0);
    for entry in &run.index.clouds {
        match Cloud::open(run, entry)? {
            Some(cloud) => clouds.push(cloud),
            None => n_left_out += entry.n_points,
        }
    }
    Ok((clouds, n_left_out))
}

/// What the clouds have.
pub(crate) fn present(clouds: &[Cloud<'_>]) -> Present {
    let any = |has: fn(&Present) -> bool| clouds.iter().any(|cloud| has(&cloud.columns.present()));
    Present {
        class: any(|present| present.class),
        instance: any(|present| present.instance),
        color: any(|present| present.color),
        lidar: any(|present| present.lidar),
        material: any(|present| present.material),
        region: any(|present| present.region),
    }
}
