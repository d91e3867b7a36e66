//! Conversion of coordinates of the clouds to coordinates of the delivery.

mod quadratic;

use crate::crs::{Crs, CrsError, VerticalDatum};
use crate::geojson::unwrapped;
use crate::run_folder::Georeference;
use formats::gtx::GeoidGrid;
use geometry::{Geodetic, Point3, Projection};
use quadratic::Quadratic;

/// The coordinate frame of the delivery.
pub struct TargetFrame<'a> {
    /// The frame of the clouds. `None` for runs in the frame of the odometry.
    georeference: Option<&'a Georeference>,
    kind: Kind,
}

enum Kind {
    /// Coordinates of the clouds, unchanged.
    AsIs,
    /// East, north and up at the origin of the run, from clouds in UTM.
    Local,
    Map(Box<MapSystem>),
}

/// A projected system, with the grid that heights refer to and its name.
struct MapSystem {
    crs: Crs,
    projection: Projection,
    geoid: Option<(String, GeoidGrid)>,
}

impl<'a> TargetFrame<'a> {
    /// The local frame of the run.
    pub fn local(georeference: Option<&'a Georeference>) -> Self {
        let is_utm = georeference.is_some_and(|georeference| georeference.is_utm() && georeference.local().is_some());
        Self { georeference, kind: if is_utm { Kind::Local } else { Kind::AsIs } }
    }

    /// A coordinate reference system. `geoid` is the grid that heights refer to, with its name; without it, heights refer
    /// to the ellipsoid.
    pub fn projected(
        georeference: &'a Georeference,
        crs: Crs,
        geoid: Option<(String, GeoidGrid)>,
    ) -> Result<Self, CrsError> {
        let projection = crs.projection()?;
        Ok(Self { georeference: Some(georeference), kind: Kind::Map(Box::new(MapSystem { crs, projection, geoid })) })
    }

    fn map(&self) -> Option<&MapSystem> {
        match &self.kind {
            Kind::Map(map) => Some(map),
            _ => None,
        }
    }

    /// Description of the system. `None` for local coordinates.
    pub fn wkt(&self) -> Option<String> {
        let (crs, vertical) = self.crs()?;
        Some(crs.wkt(&vertical))
    }

    /// System and vertical datum. `None` for local coordinates.
    pub fn crs(&self) -> Option<(&Crs, VerticalDatum)> {
        let map = self.map()?;
        let vertical =
            map.geoid.as_ref().map_or(VerticalDatum::Ellipsoid, |(name, _)| VerticalDatum::Geoid(name.clone()));
        Some((&map.crs, vertical))
    }

    /// The coordinate system in words.
    pub fn description(&self) -> String {
        match (self.crs(), self.georeference.and_then(Georeference::local)) {
            (Some((crs, vertical)), _) => format!("{} (EPSG:{}), {}, m", crs.name(), crs.epsg(), vertical.name()),
            (None, Some(local)) => {
                let Geodetic { latitude_deg, longitude_deg, altitude_m } = local.origin();
                format!("local east-north-up around {latitude_deg} {longitude_deg} {altitude_m}, m")
            }
            (None, None) => "local, not placed on the Earth, z up, m".to_owned(),
        }
    }

    /// Exact coordinates of one point.
    pub fn from_cloud(&self, xyz: [f64; 3]) -> Result<[f64; 3], CrsError> {
        let geodetic = self.georeference.map(|georeference| georeference.geodetic_from_cloud(xyz)).transpose()?;
        let (Some(Some(place)), false) = (geodetic, matches!(self.kind, Kind::AsIs)) else { return Ok(xyz) };
        self.from_geodetic(&place).map(|found| found.unwrap_or(xyz))
    }

    /// Coordinates of a geographic position. `None` if the delivery is not georeferenced.
    pub fn from_geodetic(&self, place: &Geodetic) -> Result<Option<[f64; 3]>, CrsError> {
        let Some(MapSystem { crs, projection, geoid }) = self.map() else {
            let local = self.georeference.and_then(Georeference::local);
            return Ok(local.map(|local| local.world_from_geodetic(place).coords.into()));
        };
        let [east, north, height] = map_coordinates(crs, projection, place)?;
        let undulation = geoid.as_ref().map_or(Ok(0.0), |(_, geoid)| {
            let Geodetic { latitude_deg, longitude_deg, .. } = *place;
            let height = geoid.height(latitude_deg, longitude_deg);
            height.ok_or(CrsError::OutsideGeoid { latitude_deg, longitude_deg })
        })?;
        Ok(Some([east, north, height - undulation]))
    }

    /// Coordinates of the position of a pose that is given in the local frame of the trajectory.
    pub fn from_local(&self, p: &Point3<f64>) -> Result<[f64; 3], CrsError> {
        let local = self.georeference.and_then(Georeference::local);
        let (Some(local), Some(_)) = (local, self.map()) else { return Ok(p.coords.into()) };
        Ok(self.from_geodetic(&local.geodetic_from_world(p))?.unwrap_or(p.coords.into()))
    }

    /// A converter for many points that are close together.
    pub fn converter(&self) -> Converter<'_> {
        Converter { frame: self, cells: Vec::new() }
    }

    /// Easting, northing, height above the ellipsoid, latitude and longitude in degrees, of coordinates of the clouds.
    fn smooth(&self, xyz: [f64; 3]) -> Result<[f64; 5], CrsError> {
        let geodetic =
            self.georeference.map(|georeference| georeference.geodetic_from_cloud(xyz)).transpose()?.flatten();
        let (Some(place), Some(MapSystem { crs, projection, .. })) = (geodetic, self.map()) else {
            let [x, y, z] = self.from_cloud(xyz)?;
            return Ok([x, y, z, 0.0, 0.0]);
        };
        let [east, north, height] = map_coordinates(crs, projection, &place)?;
        // Longitudes of a cell must not jump by 360 degrees at the antimeridian.
        let near = self.georeference.and_then(Georeference::local).map_or(0.0, |local| local.origin().longitude_deg);
        Ok([east, north, height, place.latitude_deg, unwrapped(place.longitude_deg, near)])
    }
}

/// Easting, northing and height above the ellipsoid, m. Projections of the library may give infinite coordinates.
fn map_coordinates(crs: &Crs, projection: &Projection, place: &Geodetic) -> Result<[f64; 3], CrsError> {
    let found = projection.project(place)?;
    let Geodetic { latitude_deg, longitude_deg, .. } = *place;
    if found.iter().any(|value| !value.is_finite()) {
        return Err(CrsError::NotFinite { epsg: crs.epsg(), latitude_deg, longitude_deg, found });
    }
    Ok(found)
}

/// Converts points that are close together. The projection is computed exactly at a few positions of each cell of 1 km,
/// and elsewhere by a quadratic through them. The difference from the exact projection is below 0.01 mm.
pub struct Converter<'a> {
    frame: &'a TargetFrame<'a>,
    /// The last cell is tried first.
    cells: Vec<Quadratic>,
}

impl Converter<'_> {
    /// Coordinates of the delivery for finite coordinates of the clouds.
    #[inline]
    pub fn convert(&mut self, xyz: [f64; 3]) -> Result<[f64; 3], CrsError> {
        if matches!(self.frame.kind, Kind::AsIs) {
            return Ok(xyz);
        }
        let [x, y, height, latitude_deg, longitude_deg] = self.cell(xyz)?.at(xyz);
        let Some(MapSystem { geoid: Some((_, geoid)), .. }) = self.frame.map() else { return Ok([x, y, height]) };
        let undulation = geoid.height(latitude_deg, longitude_deg);
        Ok([x, y, height - undulation.ok_or(CrsError::OutsideGeoid { latitude_deg, longitude_deg })?])
    }

    fn cell(&mut self, xyz: [f64; 3]) -> Result<&Quadratic, CrsError> {
        let found = self.cells.iter().rposition(|cell| cell.contains(xyz));
        let last = match found {
            Some(k) if k + 1 == self.cells.len() => k,
            Some(k) => {
                let cell = self.cells.remove(k);
                self.cells.push(cell);
                self.cells.len() - 1
            }
            None => {
                self.cells.push(Quadratic::around(xyz, |p| self.frame.smooth(p))?);
                self.cells.len() - 1
            }
        };
        Ok(&self.cells[last])
    }
}

#[cfg(test)]
mod tests;
