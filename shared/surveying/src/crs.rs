//! Coordinate reference systems: the projected systems of the EPSG registry, their heights and their WKT.

mod area;
mod code;
mod map_projection;
mod method;
mod registry;
mod vertical;

pub use area::{Area, MARGIN_DEG};
pub use code::CrsCode;
pub use map_projection::{MapProjection, Named};
pub use registry::EPSG_VERSION;
pub use vertical::{HeightSystem, VerticalDatum};

use geometry::{Geodetic, ProjectionError, Utm, UtmError};
use method::Method;
use registry::{Datum, DatumKind};

/// Systems that are listed for a place, at most.
const MAX_LISTED: usize = 8;

/// A projected coordinate reference system of the EPSG registry.
///
/// The table has systems in metres, with axes to the east and north. The datum of a system follows from positions of a receiver in one of
/// three ways:
///
/// - The receiver gives it: WGS 84, ETRS89, NAD83, GDA2020 and others. Coordinates keep the datum of the receiver, so a national datum
///   requires corrections from a network in that datum. Without them, coordinates are off by the motion of the continent since the epoch
///   of the datum: for ETRS89 and RGF93 0.9 m in 2026.
/// - A Helmert transformation from ETRS89 defines it, such as CH1903+.
/// - A grid of shifts, which [`Crs::projection`] takes as an argument.
///
/// Systems that would be wrong by more than a centimetre are refused.
#[derive(Clone, Debug, PartialEq)]
pub struct Crs {
    system: registry::System,
    datum: Datum,
    method: &'static Method,
}

/// Reason why a system cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CrsError {
    /// The number is not a projected system.
    #[error("EPSG:{0} is not a projected system of the EPSG registry (version {EPSG_VERSION})")]
    Unknown(u32),
    /// Coordinates would be wrong, or not in metres to the east and north.
    #[error("EPSG:{epsg} ({name}) is not supported: {reason}")]
    Refused {
        /// Number of the system.
        epsg: u32,
        /// Name of the system.
        name: &'static str,
        /// Reason in words.
        reason: String,
    },
    /// The number is not a vertical system.
    #[error("EPSG:{0} is not a vertical system of the EPSG registry (version {EPSG_VERSION}) with heights in metres")]
    UnknownHeight(u32),
    /// The datum needs a grid.
    #[error("EPSG:{epsg} ({name}) needs a grid of its datum in the format NTv2: {grids}")]
    NeedsGrid {
        /// Number of the system.
        epsg: u32,
        /// Name of the system.
        name: &'static str,
        /// Names of the grids, their areas and accuracies.
        grids: String,
    },
    /// The datum needs no grid.
    #[error("EPSG:{epsg} ({name}) needs no grid of its datum, {grid} was given")]
    NeedsNoGrid {
        /// Number of the system.
        epsg: u32,
        /// Name of the system.
        name: &'static str,
        /// Name of the grid.
        grid: String,
    },
    /// The registry does not name the grid for the datum.
    #[error("EPSG:{epsg} ({name}) has no grid {grid} in the EPSG registry; expected {grids}")]
    OtherGrid {
        /// Number of the system.
        epsg: u32,
        /// Name of the system.
        name: &'static str,
        /// Name of the grid.
        grid: String,
        /// Names of the grids, their areas and accuracies.
        grids: String,
    },
    /// The projection failed.
    #[error(transparent)]
    Projection(#[from] ProjectionError),
    /// The projection gave coordinates that are not finite.
    #[error(
        "latitude {latitude_deg:.6} longitude {longitude_deg:.6} has no coordinates in EPSG:{epsg}: {found:?}; expected finite numbers"
    )]
    NotFinite {
        /// Number of the system.
        epsg: u32,
        /// Degrees, north positive.
        latitude_deg: f64,
        /// Degrees, east positive.
        longitude_deg: f64,
        /// Easting, northing and height, m.
        found: [f64; 3],
    },
    /// The position has no UTM zone.
    #[error(transparent)]
    Utm(#[from] UtmError),
    /// The geoid grid does not cover a position.
    #[error(
        "latitude {latitude_deg:.6} longitude {longitude_deg:.6} is outside of the geoid grid, or next to nodes without value"
    )]
    OutsideGeoid {
        /// Degrees, north positive.
        latitude_deg: f64,
        /// Degrees, east positive.
        longitude_deg: f64,
    },
    /// The grid of the datum does not cover a position.
    #[error("latitude {latitude_deg:.6} longitude {longitude_deg:.6} is outside of the datum grid {grid}")]
    OutsideGrid {
        /// Name of the grid.
        grid: String,
        /// Degrees, north positive.
        latitude_deg: f64,
        /// Degrees, east positive.
        longitude_deg: f64,
    },
}

impl Crs {
    /// The system of an EPSG number.
    pub fn from_epsg(epsg: u32) -> Result<Self, CrsError> {
        let Some(system) = registry::system(epsg) else {
            return Err(match registry::refusal(epsg) {
                Some((name, reason)) => CrsError::Refused { epsg, name, reason },
                None => CrsError::Unknown(epsg),
            });
        };
        Self::from_system(system).ok_or(CrsError::Unknown(epsg))
    }

    fn from_system(system: registry::System) -> Option<Self> {
        let datum = registry::datum(system.datum)?;
        let method = method::method(system.method)?;
        Some(Self { system, datum, method })
    }

    /// WGS 84 / UTM in the zone of a position.
    pub fn utm_of(place: &Geodetic) -> Result<Self, CrsError> {
        Self::from_epsg(Utm::from_geodetic(place)?.epsg())
    }

    /// Number in the EPSG registry.
    pub const fn epsg(&self) -> u32 {
        self.system.epsg
    }
    /// Where the system is defined.
    pub const fn area(&self) -> &Area {
        &self.system.area
    }
    /// Name in the EPSG registry.
    pub const fn name(&self) -> &'static str {
        self.system.name
    }
    /// Whether [`Crs::projection`] needs a grid.
    pub fn needs_grid(&self) -> bool {
        self.datum.kind == DatumKind::Grid
    }

    /// Up to 8 systems whose area of use contains a position and that need no grid: WGS 84 / UTM and ETRS89 / UTM of its zone, then the
    /// systems with the smallest areas. UTM ends before the poles.
    pub fn containing(place: &Geodetic) -> Vec<Self> {
        let utm = Utm::from_geodetic(place).ok();
        let zones: Vec<u32> =
            utm.iter().flat_map(|utm| [utm.epsg(), 25_800 + utm.zone()]).filter(|epsg| *epsg != 0).collect();
        let rank = |crs: &Self| zones.iter().position(|epsg| *epsg == crs.epsg()).unwrap_or(zones.len());
        let mut found: Vec<Self> = registry::systems()
            .filter(|system| system.area.contains(place))
            .filter_map(Self::from_system)
            .filter(|crs| !crs.needs_grid())
            .collect();
        found.sort_by(|a, b| {
            let by_size = a.area().square_deg().total_cmp(&b.area().square_deg());
            rank(a).cmp(&rank(b)).then(by_size).then(a.epsg().cmp(&b.epsg()))
        });
        found.truncate(MAX_LISTED);
        found
    }

    /// WKT 1 of this system with a height (OGC 01-009), as LAS 1.4 requires.
    pub fn wkt(&self, vertical: &VerticalDatum) -> String {
        let registry::System { epsg, name, axes, ref values, .. } = self.system;
        let vertical_name = vertical.name();
        let axes = match axes {
            "EN" => r#"AXIS["Easting",EAST],AXIS["Northing",NORTH],"#,
            // Readers of maps (GDAL, QGIS, PDAL) take the first coordinate of a file as the easting all the same.
            "NE" => r#"AXIS["Northing",NORTH],AXIS["Easting",EAST],"#,
            _ => "",
        };
        format!(
            r#"COMPD_CS["{name} + {vertical_name}",PROJCS["{name}",{},{}{METRE},{axes}AUTHORITY["EPSG","{epsg}"]],{}]"#,
            self.datum.wkt,
            self.method.wkt(values),
            vertical.wkt()
        )
    }
}

/// The unit in WKT.
const METRE: &str = r#"UNIT["metre",1,AUTHORITY["EPSG","9001"]]"#;

#[cfg(test)]
mod tests;
