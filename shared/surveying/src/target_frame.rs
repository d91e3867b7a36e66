//! Conversion of coordinates of the clouds to coordinates of the delivery.

mod quadratic;

use crate::crs::{Crs, CrsError, HeightSystem, MapProjection, Named, VerticalDatum};
use crate::geojson::unwrapped;
use crate::run_folder::Georeference;
use formats::gtx::GeoidGrid;
use formats::ntv2::DatumGrid;
use geometry::{Geodetic, Point3};
use quadratic::Quadratic;
use std::sync::Arc;

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

/// A coordinate reference system with the files that it needs.
#[derive(Clone, Debug)]
pub struct MapChoice {
    /// The projected system.
    pub crs: Crs,
    /// The vertical system. `None`: the system that the name of the geoid grid indicates, or without geoid the ellipsoid.
    pub height: Option<HeightSystem>,
    /// The grid that heights refer to. `None`: heights above the ellipsoid.
    pub geoid: Option<Named<GeoidGrid>>,
    /// The grid of the datum, for systems that need one.
    pub datum_grid: Option<Arc<Named<DatumGrid>>>,
}

impl From<Crs> for MapChoice {
    /// Heights above the ellipsoid, without grids.
    fn from(crs: Crs) -> Self {
        Self { crs, height: None, geoid: None, datum_grid: None }
    }
}

/// A projected system, with the grid that heights refer to.
struct MapSystem {
    crs: Crs,
    projection: MapProjection,
    vertical: VerticalDatum,
    geoid: Option<GeoidGrid>,
}

impl<'a> TargetFrame<'a> {
    /// The local frame of the run.
    pub fn local(georeference: Option<&'a Georeference>) -> Self {
        let is_utm = georeference.is_some_and(|georeference| georeference.is_utm() && georeference.local().is_some());
        Self { georeference, kind: if is_utm { Kind::Local } else { Kind::AsIs } }
    }

    /// A coordinate reference system.
    pub fn projected(georeference: &'a Georeference, choice: impl Into<MapChoice>) -> Result<Self, CrsError> {
        let MapChoice { crs, height, geoid, datum_grid } = choice.into();
        let projection = crs.projection(datum_grid.as_ref())?;
        let vertical = match (height, &geoid) {
            (_, None) => VerticalDatum::Ellipsoid,
            (Some(height), Some(_)) => VerticalDatum::Registered(height),
            (None, Some(geoid)) => VerticalDatum::from_grid_name(&geoid.name),
        };
        let map = MapSystem { crs, projection, vertical, geoid: geoid.map(|geoid| geoid.grid) };
        Ok(Self { georeference: Some(georeference), kind: Kind::Map(Box::new(map)) })
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
        Some(crs.wkt(vertical))
    }

    /// System and vertical datum. `None` for local coordinates.
    pub fn crs(&self) -> Option<(&Crs, &VerticalDatum)> {
        self.map().map(|map| (&map.crs, &map.vertical))
    }

    /// Name of the grid of the datum, for systems that need one.
    pub fn datum_grid(&self) -> Option<&str> {
        self.map()?.projection.grid_name()
    }

    /// The coordinate system in words.
    pub fn description(&self) -> String {
        match (self.crs(), self.georeference.and_then(Georeference::local)) {
            (Some((crs, vertical)), _) => {
                let grid = self.datum_grid().map_or_else(String::new, |grid| format!(", datum grid {grid}"));
                format!("{} (EPSG:{}), {}{grid}, m", crs.name(), crs.epsg(), vertical.name())
            }
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
        let Some(MapSystem { crs, projection, geoid, .. }) = self.map() else {
            let local = self.georeference.and_then(Georeference::local);
            return Ok(local.map(|local| local.world_from_geodetic(place).coords.into()));
        };
        let [east, north, height] = map_coordinates(crs, projection, place)?;
        let undulation = geoid.as_ref().map_or(Ok(0.0), |geoid| {
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
fn map_coordinates(crs: &Crs, projection: &MapProjection, place: &Geodetic) -> Result<[f64; 3], CrsError> {
    let found = projection.project(place)?;
    let Geodetic { latitude_deg, longitude_deg, .. } = *place;
    if found.iter().any(|value| !value.is_finite()) {
        return Err(CrsError::NotFinite { epsg: crs.epsg(), latitude_deg, longitude_deg, found });
    }
    Ok(found)
}

/// Converts points that are close together. The projection is computed exactly at a few positions of each cell of 1 km,
/// and elsewhere by a quadratic through them. The difference from the exact projection is below 0.01 mm. With a grid of the datum, which
/// is not smooth at the edges of its cells, each point is projected.
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
        if self.frame.map().is_some_and(|map| !map.projection.is_smooth()) {
            return self.frame.from_cloud(xyz);
        }
        let [x, y, height, latitude_deg, longitude_deg] = self.cell(xyz)?.at(xyz);
        let Some(MapSystem { geoid: Some(geoid), .. }) = self.frame.map() else { return Ok([x, y, height]) };
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
