//! `survey.toml`: the drives and points of a survey.

use crate::data::deliver::frame::open_system;
use anyhow::{Context, bail, ensure};
use files::text_file::read_toml;
use formats::gtx::GeoidGrid;
use geometry::Geodetic;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use surveying::MapChoice;
use surveying::crs::{CrsCode, MapProjection};

/// The whole file. Paths are relative to its folder.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wanted {
    version: u32,
    pub drives: Vec<Drive>,
    pub points: Option<Points>,
}

/// A drive.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drive {
    /// Output folder of its finished run.
    pub run: PathBuf,
    /// Its name; by default the name of that folder.
    #[serde(default)]
    pub name: String,
}

/// Control and check points.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Points {
    /// The table.
    pub file: PathBuf,
    /// Coordinate reference system of the table, `EPSG:N`, or with its heights `EPSG:N+M`.
    crs: String,
    /// Grid that its heights refer to; without it, they are above the ellipsoid.
    geoid: Option<PathBuf>,
    /// Grid of its datum, for systems that need one.
    grid: Option<PathBuf>,
}

/// The coordinates of a table of points.
pub struct PointSystem {
    projection: MapProjection,
    geoid: Option<GeoidGrid>,
}

impl Wanted {
    /// Reads the file.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        let place = || path.display().to_string();
        let mut wanted: Self = read_toml(path).with_context(place)?;
        ensure!(wanted.version == 1, "{}: version {}; must be 1", place(), wanted.version);
        ensure!(!wanted.drives.is_empty(), "{}: has no [[drives]]", place());
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut names = BTreeSet::new();
        for drive in &mut wanted.drives {
            if drive.name.is_empty() {
                let name = drive.run.file_name().unwrap_or_default();
                drive.name = name.to_string_lossy().into_owned();
            }
            let is_plain = !drive.name.starts_with('.') && !drive.name.contains(['/', '\\']);
            ensure!(
                is_plain && !drive.name.is_empty(),
                "{}: drive name {:?}; it becomes a folder of deliveries, so it must not be empty, begin with a dot or contain slashes",
                place(),
                drive.name
            );
            ensure!(
                names.insert(drive.name.clone()),
                "{}: two drives are named {:?}; give each a `name`",
                place(),
                drive.name
            );
            drive.run = folder.join(&drive.run);
        }
        if let Some(points) = &mut wanted.points {
            points.file = folder.join(&points.file);
            for grid in [&mut points.geoid, &mut points.grid].into_iter().flatten() {
                *grid = folder.join(&*grid);
            }
        }
        Ok(wanted)
    }
}

impl Points {
    /// The system of the table.
    pub fn system(&self) -> anyhow::Result<PointSystem> {
        let Ok(code) = self.crs.parse::<CrsCode>() else {
            bail!("points.crs: {:?} must be EPSG:N or EPSG:N+M", self.crs)
        };
        let MapChoice { crs, geoid, datum_grid, .. } =
            open_system(code, self.geoid.as_deref(), self.grid.as_deref()).context("points")?;
        let projection = crs.projection(datum_grid.as_ref()).context("points.crs")?;
        let geoid = geoid.map(|geoid| geoid.grid);
        Ok(PointSystem { projection, geoid })
    }
}

impl PointSystem {
    /// The position on the Earth of coordinates of the table.
    pub fn geodetic(&self, xyz: [f64; 3]) -> Result<Geodetic, String> {
        let mut place = self.projection.unproject(xyz).map_err(|error| error.to_string())?;
        if let Some(geoid) = &self.geoid {
            let height = geoid.height(place.latitude_deg, place.longitude_deg);
            let outside =
                || format!("{:.6} {:.6} is outside of the geoid grid", place.latitude_deg, place.longitude_deg);
            place.altitude_m += height.ok_or_else(outside)?;
        }
        Ok(place)
    }
}
