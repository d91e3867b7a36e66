//! Map coordinates of positions of a receiver: shift to the datum of the system, then its projection.

use super::registry::{self, DatumKind};
use super::{Crs, CrsError};
use formats::ntv2::DatumGrid;
use geometry::{Geodetic, Projection};
use std::sync::Arc;

/// A grid with the name of its file, which results state.
#[derive(Clone, Debug)]
pub struct Named<G> {
    /// Name of the file, without folder.
    pub name: String,
    /// Its content.
    pub grid: G,
}

/// Rounds of the inverse of a Helmert transformation. The height changes the shift by 1 part in 100 000 for each 60 m, so the first round
/// leaves at most a few centimetres, and the third less than a nanometre.
const ROUNDS: usize = 3;

/// A projection from positions of a receiver to coordinates of a system, and back.
#[derive(Debug)]
pub struct MapProjection {
    projection: Projection,
    shift: Shift,
}

/// How the datum of the system follows from positions of a receiver.
#[derive(Clone, Debug)]
enum Shift {
    None,
    /// The projection itself contains the shift.
    Helmert,
    Grid {
        grid: Arc<Named<DatumGrid>>,
        /// Whether the shifts lead from the datum to positions of a receiver.
        is_to_satellite: bool,
    },
}

impl Crs {
    /// The projection. `grid` is required if [`Crs::needs_grid`], and must be one of the grids of the registry, by its name.
    pub fn projection(&self, grid: Option<&Arc<Named<DatumGrid>>>) -> Result<MapProjection, CrsError> {
        let epsg = self.epsg();
        let name = self.name();
        let [a, rf] = self.datum.ellipsoid;
        let ellipsoid = format!("+a={a} +rf={rf}");
        let definition = self.method.definition(&self.system.values);
        let (projection, shift) = match (&self.datum.kind, grid) {
            (DatumKind::Satellite | DatumKind::Helmert(_), Some(grid)) => {
                return Err(CrsError::NeedsNoGrid { epsg, name, grid: grid.name.clone() });
            }
            (DatumKind::Satellite, None) => (Projection::new(&definition, &ellipsoid)?, Shift::None),
            (DatumKind::Helmert(parameters), None) => {
                (Projection::shifted(&definition, &ellipsoid, parameters)?, Shift::Helmert)
            }
            (DatumKind::Grid, None) => return Err(CrsError::NeedsGrid { epsg, name, grids: self.grids_in_words() }),
            (DatumKind::Grid, Some(grid)) => {
                let known = registry::grids(self.system.datum);
                let found = known.iter().find(|known| is_name_of(known, &grid.name));
                let other =
                    || CrsError::OtherGrid { epsg, name, grid: grid.name.clone(), grids: self.grids_in_words() };
                let is_to_satellite = found.ok_or_else(other)?.is_to_satellite;
                let shift = Shift::Grid { grid: Arc::clone(grid), is_to_satellite };
                (Projection::new(&definition, &ellipsoid)?, shift)
            }
        };
        Ok(MapProjection { projection, shift })
    }

    fn grids_in_words(&self) -> String {
        let grids = registry::grids(self.system.datum);
        let words = grids.iter().map(|grid| format!("{} ({} Accurate to {} m)", grid.name, grid.area, grid.accuracy_m));
        words.collect::<Vec<_>>().join(", ")
    }
}

/// Whether a file is a grid of the registry: by its name without regard to case. The GeoTIFF files of PROJ have other names, and
/// longitudes to the east; a program that converts them as they are gives shifts of the wrong sign.
fn is_name_of(known: &registry::Grid, file: &str) -> bool {
    known.name.eq_ignore_ascii_case(file)
}

impl MapProjection {
    /// Easting, northing and height above the ellipsoid of the receiver's datum, m. Coordinates are within 0.15 mm of PROJ in the area of
    /// the system; they may be infinite far outside.
    pub fn project(&self, place: &Geodetic) -> Result<[f64; 3], CrsError> {
        let [east, north, _] = match &self.shift {
            Shift::None | Shift::Helmert => self.projection.project(place)?,
            Shift::Grid { grid, is_to_satellite } => {
                self.projection.project(&shifted(grid, place, !is_to_satellite)?)?
            }
        };
        // The height of a Helmert transformation refers to the ellipsoid of the old datum, from which nobody measures heights.
        Ok([east, north, place.altitude_m])
    }

    /// The position of easting, northing and height above the ellipsoid of the receiver's datum, m.
    pub fn unproject(&self, [east, north, height]: [f64; 3]) -> Result<Geodetic, CrsError> {
        let at_height = |place: Geodetic| Geodetic { altitude_m: height, ..place };
        match &self.shift {
            Shift::None => Ok(self.projection.unproject([east, north, height])?),
            Shift::Grid { grid, is_to_satellite } => {
                let place = self.projection.unproject([east, north, height])?;
                shifted(grid, &place, *is_to_satellite)
            }
            Shift::Helmert => {
                let mut wanted = [east, north];
                let mut place = at_height(self.projection.unproject([east, north, height])?);
                for _ in 0..ROUNDS {
                    let found = self.projection.project(&place)?;
                    wanted = [wanted[0] + east - found[0], wanted[1] + north - found[1]];
                    place = at_height(self.projection.unproject([wanted[0], wanted[1], height])?);
                }
                Ok(place)
            }
        }
    }

    /// Whether coordinates are a smooth function of the position: grids have edges in their cells.
    pub(crate) fn is_smooth(&self) -> bool {
        !matches!(self.shift, Shift::Grid { .. })
    }

    /// Name of the datum grid.
    pub(crate) fn grid_name(&self) -> Option<&str> {
        match &self.shift {
            Shift::Grid { grid, .. } => Some(&grid.name),
            Shift::None | Shift::Helmert => None,
        }
    }
}

/// A position moved by a grid, forwards or backwards.
fn shifted(grid: &Named<DatumGrid>, place: &Geodetic, is_forward: bool) -> Result<Geodetic, CrsError> {
    let Geodetic { latitude_deg, longitude_deg, altitude_m } = *place;
    let outside = || CrsError::OutsideGrid { grid: grid.name.clone(), latitude_deg, longitude_deg };
    let from = [latitude_deg, longitude_deg];
    let found = if is_forward { grid.grid.forward(from) } else { grid.grid.inverse(from) };
    let [latitude_deg, longitude_deg] = found.ok_or_else(outside)?;
    Geodetic::new(latitude_deg, longitude_deg, altitude_m).ok_or_else(outside)
}
