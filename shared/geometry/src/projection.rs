//! Map projections, given by their PROJ definitions.

use crate::Geodetic;
use proj4rs::Proj;
use proj4rs::transform::transform;

/// A map projection, and the geographic coordinates of the positions. Only [`Projection::shifted`] changes the datum:
/// positions keep the datum of the receiver.
#[derive(Debug)]
pub struct Projection {
    geodetic: Proj,
    projected: Proj,
}

/// The projection library failed: an invalid definition, or a position that it does not cover.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ProjectionError(String);

impl Projection {
    /// A projection to coordinates in m. `ellipsoid` is a parameter that names the ellipsoid, such as `+datum=WGS84` or `+ellps=GRS80`;
    /// `definition` are the other parameters, such as `+proj=utm +zone=31`.
    pub fn new(definition: &str, ellipsoid: &str) -> Result<Self, ProjectionError> {
        let make = |text: &str| Proj::from_proj_string(text).map_err(|cause| ProjectionError(cause.to_string()));
        Ok(Self {
            geodetic: make(&format!("+proj=latlong {ellipsoid} +no_defs"))?,
            projected: make(&format!("{definition} {ellipsoid} +units=m +no_defs"))?,
        })
    }
    /// A projection whose datum follows from WGS 84 by a Helmert transformation. `parameters` transform the datum to WGS 84 by position
    /// vectors: three translations in m, three rotations in arc seconds, the scale difference in parts per million. Heights are above
    /// the ellipsoid of the datum after [`Self::project`], and above WGS 84 after [`Self::unproject`].
    pub fn shifted(definition: &str, ellipsoid: &str, parameters: &[f64; 7]) -> Result<Self, ProjectionError> {
        let make = |text: &str| Proj::from_proj_string(text).map_err(|cause| ProjectionError(cause.to_string()));
        let parameters = parameters.map(|value| value.to_string()).join(",");
        Ok(Self {
            geodetic: make("+proj=latlong +datum=WGS84 +no_defs")?,
            projected: make(&format!("{definition} {ellipsoid} +towgs84={parameters} +units=m +no_defs"))?,
        })
    }
    /// Easting, northing (m, within 0.1 mm in the area of the projection) and height above the ellipsoid (m).
    pub fn project(&self, place: &Geodetic) -> Result<[f64; 3], ProjectionError> {
        let mut point = (place.longitude_deg.to_radians(), place.latitude_deg.to_radians(), place.altitude_m);
        transform(&self.geodetic, &self.projected, &mut point).map_err(|cause| ProjectionError(cause.to_string()))?;
        Ok([point.0, point.1, point.2])
    }
    /// The position of easting, northing and height above the ellipsoid, m.
    pub fn unproject(&self, [east, north, height]: [f64; 3]) -> Result<Geodetic, ProjectionError> {
        let mut point = (east, north, height);
        transform(&self.projected, &self.geodetic, &mut point).map_err(|cause| ProjectionError(cause.to_string()))?;
        let outside = || ProjectionError(format!("{east} {north} {height} has no geographic position"));
        Geodetic::new(point.1.to_degrees(), point.0.to_degrees(), point.2).ok_or_else(outside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference coordinates from pyproj 3.7.2 (PROJ 9.5.1), `Transformer.from_crs(4979, 2154)`.
    #[test]
    fn lambert_coordinates_equal_proj_and_convert_back() {
        let definition = "+proj=lcc +lat_0=46.5 +lon_0=3 +lat_1=49 +lat_2=44 +x_0=700000 +y_0=6600000";
        let lambert_93 = Projection::new(definition, "+ellps=GRS80").expect("a projection");
        for (lat, lon, expected) in
            [(48.846_222, 2.346_414, LAMBERT_93[0]), (43.296_5, 5.369_8, LAMBERT_93[1]), (50.95, 1.85, LAMBERT_93[2])]
        {
            let place = Geodetic::new(lat, lon, 12.5).expect("a position");
            let found = lambert_93.project(&place).expect("projects");
            assert!((found[0] - expected[0]).hypot(found[1] - expected[1]) < 1e-3, "{lat} {lon}: {found:?}");
            assert_eq!(found[2], 12.5);
            let back = lambert_93.unproject(found).expect("unprojects");
            assert!((back.latitude_deg - lat).abs() < 1e-9 && (back.longitude_deg - lon).abs() < 1e-9, "{back:?}");
        }
    }

    const LAMBERT_93: [[f64; 2]; 3] =
        [[652_034.945_1, 6_860_884.820_9], [892_390.221_6, 6_247_035.256_8], [619_017.169_9, 7_095_479.907_9]];

    #[test]
    fn invalid_definition_is_reported() {
        let error = Projection::new("+proj=potato", "+datum=WGS84").expect_err("an unknown projection is refused");
        assert!(!error.to_string().is_empty());
    }
}
