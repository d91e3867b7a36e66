//! `survey.toml`: the drives and points of a survey.

use anyhow::{Context, bail, ensure};
use files::text_file::read_toml;
use formats::gtx::GeoidGrid;
use geometry::{Geodetic, Projection};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use surveying::crs::Crs;

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
    /// Coordinate reference system of the table, `EPSG:N`.
    crs: String,
    /// Grid that its heights refer to; without it, they are above the ellipsoid.
    geoid: Option<PathBuf>,
}

/// The coordinates of a table of points.
pub struct PointSystem {
    projection: Projection,
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
            points.geoid = points.geoid.as_ref().map(|geoid| folder.join(geoid));
        }
        Ok(wanted)
    }
}

impl Points {
    /// The system of the table.
    pub fn system(&self) -> anyhow::Result<PointSystem> {
        let epsg = self.crs.strip_prefix("EPSG:").and_then(|number| number.parse().ok());
        let Some(epsg) = epsg else { bail!("points.crs: {:?} must be EPSG:N", self.crs) };
        let projection = Crs::from_epsg(epsg).and_then(|crs| Ok(crs.projection()?)).context("points.crs")?;
        let geoid = self.geoid.as_deref().map(GeoidGrid::load).transpose()?;
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
