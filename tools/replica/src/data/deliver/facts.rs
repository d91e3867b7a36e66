//! `delivery.json`: what was delivered.

use super::frame::ChosenFrame;
use anyhow::Context;
use files::atomic_file::write_atomic;
use geometry::Stamp;
use serde::Serialize;
use std::path::Path;
use surveying::{LeftOut, PointFile, RunFolder};

/// Name of the file.
pub(super) const FILE: &str = "delivery.json";

/// The whole file.
#[derive(Serialize)]
pub struct Facts<'a> {
    /// Version of this file format.
    version: u32,
    software: &'static str,
    /// Coordinates in words.
    pub frame: String,
    /// EPSG number; null for local coordinates.
    epsg: Option<u32>,
    /// Vertical datum; null for local coordinates.
    heights: Option<String>,
    /// EPSG number of the vertical datum; null for ellipsoidal heights, unknown geoids and local coordinates.
    heights_epsg: Option<u32>,
    /// Grid of the datum; left out if the system needs none.
    #[serde(skip_serializing_if = "Option::is_none")]
    datum_grid: Option<&'a str>,
    /// Why coordinates are local although a reference system was wanted.
    unreferenced: Option<&'a str>,
    /// Where the drive is outside of the area of use of the reference system; left out if it is inside or within the margin.
    #[serde(skip_serializing_if = "Option::is_none")]
    outside_area: Option<&'a str>,
    /// Time of the first shot, s since the Unix epoch.
    begin_s: Option<String>,
    pub n_points: u64,
    pub left_out: Left,
    /// Files with points.
    files: &'a [PointFile],
}

/// Points that were left out of the files.
#[derive(Serialize)]
pub struct Left {
    pub without_place: u64,
    pub not_finite: u64,
}

impl<'a> Facts<'a> {
    pub fn new(
        runs: &[RunFolder],
        ChosenFrame { target, unreferenced, outside_area }: &'a ChosenFrame<'_>,
        n_points: u64,
        files: &'a [PointFile],
        LeftOut { without_place, not_finite }: LeftOut,
    ) -> Self {
        let crs = target.crs();
        Self {
            version: 1,
            software: concat!("REPLICA ", env!("CARGO_PKG_VERSION")),
            frame: target.description(),
            epsg: crs.as_ref().map(|(crs, _)| crs.epsg()),
            heights: crs.as_ref().map(|(_, vertical)| vertical.name()),
            heights_epsg: crs.as_ref().and_then(|(_, vertical)| vertical.epsg()),
            datum_grid: target.datum_grid(),
            unreferenced: unreferenced.as_deref(),
            outside_area: outside_area.as_deref(),
            begin_s: runs.iter().filter_map(RunFolder::begin_nanos).min().map(|nanos| Stamp(nanos).to_string()),
            n_points,
            left_out: Left { without_place, not_finite },
            files,
        }
    }

    /// Writes the file into the folder of the delivery.
    pub fn write(&self, out: &Path) -> anyhow::Result<()> {
        let path = out.join(FILE);
        let text = serde_json::to_string_pretty(self).context(FILE)? + "\n";
        write_atomic(&path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))
    }
}
