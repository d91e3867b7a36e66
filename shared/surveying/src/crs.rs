//! Coordinate reference systems: the supported systems of the EPSG registry and their WKT.

mod area;
mod vertical;

pub use area::{Area, MARGIN_DEG};
pub use vertical::VerticalDatum;

use geometry::{Geodetic, Projection, ProjectionError, Utm, UtmError};

/// A projected coordinate reference system of the EPSG registry.
///
/// | EPSG | system |
/// |---|---|
/// | 32601 to 32660, 32701 to 32760 | WGS 84 / UTM, north and south |
/// | 25828 to 25838 | ETRS89 / UTM zone 28N to 38N |
/// | 2154 | RGF93 v1 / Lambert-93 |
/// | 3942 to 3950 | RGF93 v1 / CC42 to CC50 |
/// | 3812 | ETRS89 / Belgian Lambert 2008 |
///
/// Coordinates keep the datum of the receiver. ETRS89 and RGF93 require corrections from a network in that datum. Without
/// them, coordinates are off by the motion of the continent since 1989, 0.9 m in 2026.
#[derive(Clone, Debug, PartialEq)]
pub struct Crs {
    epsg: u32,
    name: String,
    datum: &'static Datum,
    method: Method,
}

/// Reason why a system cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CrsError {
    /// The number is not supported.
    #[error(
        "EPSG:{0} is not supported; use WGS 84 / UTM (32601 to 32660, 32701 to 32760), ETRS89 / UTM (25828 to 25838), Lambert-93 (2154), \
         CC42 to CC50 (3942 to 3950) or Belgian Lambert 2008 (3812)"
    )]
    Unsupported(u32),
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
}

/// A geodetic datum.
#[derive(Debug, PartialEq)]
struct Datum {
    /// Parameter of PROJ.
    ellipsoid: &'static str,
    /// `GEOGCS` in WKT.
    wkt: &'static str,
}

const WGS_84: Datum = Datum {
    ellipsoid: "+datum=WGS84",
    wkt: r#"GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4326"]]"#,
};
const ETRS89: Datum = Datum {
    ellipsoid: "+ellps=GRS80",
    wkt: r#"GEOGCS["ETRS89",DATUM["European_Terrestrial_Reference_System_1989",SPHEROID["GRS 1980",6378137,298.257222101,AUTHORITY["EPSG","7019"]],AUTHORITY["EPSG","6258"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4258"]]"#,
};
const RGF93: Datum = Datum {
    ellipsoid: "+ellps=GRS80",
    wkt: r#"GEOGCS["RGF93 v1",DATUM["Reseau_Geodesique_Francais_1993_v1",SPHEROID["GRS 1980",6378137,298.257222101,AUTHORITY["EPSG","7019"]],AUTHORITY["EPSG","6171"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4171"]]"#,
};

/// A projection with its parameters, degrees and m.
#[derive(Clone, Debug, PartialEq)]
enum Method {
    TransverseMercator { zone: u32, is_north: bool },
    LambertConic { origin_deg: [f64; 2], parallels_deg: [f64; 2], false_origin_m: [f64; 2] },
}

impl Crs {
    /// The system of an EPSG number.
    pub fn from_epsg(epsg: u32) -> Result<Self, CrsError> {
        let utm = |zone: u32, is_north: bool, name: &str, datum: &'static Datum| {
            let name = format!("{name} / UTM zone {zone}{}", if is_north { 'N' } else { 'S' });
            Self { epsg, name, datum, method: Method::TransverseMercator { zone, is_north } }
        };
        let lambert = |name: String, datum: &'static Datum, method: Method| Self { epsg, name, datum, method };
        Ok(match epsg {
            32_601..=32_660 => utm(epsg - 32_600, true, "WGS 84", &WGS_84),
            32_701..=32_760 => utm(epsg - 32_700, false, "WGS 84", &WGS_84),
            25_828..=25_838 => utm(epsg - 25_800, true, "ETRS89", &ETRS89),
            2154 => lambert(
                "RGF93 v1 / Lambert-93".to_owned(),
                &RGF93,
                Method::LambertConic {
                    origin_deg: [46.5, 3.0],
                    parallels_deg: [49.0, 44.0],
                    false_origin_m: [700_000.0, 6_600_000.0],
                },
            ),
            3942..=3950 => {
                let parallel = epsg - 3900;
                let latitude_deg = f64::from(parallel);
                let method = Method::LambertConic {
                    origin_deg: [latitude_deg, 3.0],
                    parallels_deg: [latitude_deg - 0.75, latitude_deg + 0.75],
                    false_origin_m: [1_700_000.0, f64::from(parallel - 41) * 1e6 + 200_000.0],
                };
                lambert(format!("RGF93 v1 / CC{parallel}"), &RGF93, method)
            }
            3812 => lambert(
                "ETRS89 / Belgian Lambert 2008".to_owned(),
                &ETRS89,
                Method::LambertConic {
                    origin_deg: [50.797_815, 4.359_215_833_333_333],
                    parallels_deg: [49.0 + 5.0 / 6.0, 51.0 + 1.0 / 6.0],
                    false_origin_m: [649_328.0, 665_262.0],
                },
            ),
            _ => return Err(CrsError::Unsupported(epsg)),
        })
    }

    /// WGS 84 / UTM in the zone of a position.
    pub fn utm_of(place: &Geodetic) -> Result<Self, CrsError> {
        Self::from_epsg(Utm::from_geodetic(place)?.epsg())
    }

    /// Number in the EPSG registry.
    pub const fn epsg(&self) -> u32 {
        self.epsg
    }
    /// Where the system is defined.
    pub fn area(&self) -> Area {
        Area::from_epsg(self.epsg)
    }
    /// The systems whose area of use contains a position: WGS 84 / UTM of its zone first. Empty near the poles.
    pub fn containing(place: &Geodetic) -> Vec<Self> {
        let utm = Self::utm_of(place).ok();
        let national = (25_828..=25_838).chain([2154]).chain(3942..=3950).chain([3812]);
        let national = national.filter_map(|epsg| Self::from_epsg(epsg).ok());
        utm.into_iter().chain(national.filter(|crs| crs.area().contains(place))).collect()
    }
    /// Name in the EPSG registry.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The projection from geographic coordinates.
    pub fn projection(&self) -> Result<Projection, ProjectionError> {
        let definition = match &self.method {
            Method::TransverseMercator { zone, is_north } => {
                format!("+proj=utm +zone={zone}{}", if *is_north { "" } else { " +south" })
            }
            Method::LambertConic { origin_deg: [lat, lon], parallels_deg: [a, b], false_origin_m: [x, y] } => {
                format!("+proj=lcc +lat_0={lat} +lon_0={lon} +lat_1={a} +lat_2={b} +x_0={x} +y_0={y}")
            }
        };
        Projection::new(&definition, self.datum.ellipsoid)
    }

    /// WKT 1 of this system with a height (OGC 01-009), as LAS 1.4 requires.
    pub fn wkt(&self, vertical: &VerticalDatum) -> String {
        let name = &self.name;
        let epsg = self.epsg;
        let vertical_name = vertical.name();
        let (method, parameters) = match &self.method {
            Method::TransverseMercator { zone, is_north } => (
                "Transverse_Mercator",
                vec![
                    ("latitude_of_origin", 0.0),
                    ("central_meridian", f64::from(*zone) * 6.0 - 183.0),
                    ("scale_factor", 0.9996),
                    ("false_easting", 500_000.0),
                    ("false_northing", if *is_north { 0.0 } else { 10_000_000.0 }),
                ],
            ),
            Method::LambertConic { origin_deg, parallels_deg, false_origin_m } => (
                "Lambert_Conformal_Conic_2SP",
                vec![
                    ("latitude_of_origin", origin_deg[0]),
                    ("central_meridian", origin_deg[1]),
                    ("standard_parallel_1", parallels_deg[0]),
                    ("standard_parallel_2", parallels_deg[1]),
                    ("false_easting", false_origin_m[0]),
                    ("false_northing", false_origin_m[1]),
                ],
            ),
        };
        let parameters: Vec<String> =
            parameters.iter().map(|(name, value)| format!(r#"PARAMETER["{name}",{value}],"#)).collect();
        format!(
            r#"COMPD_CS["{name} + {vertical_name}",PROJCS["{name}",{},PROJECTION["{method}"],{}{METRE},AXIS["Easting",EAST],AXIS["Northing",NORTH],AUTHORITY["EPSG","{epsg}"]],{}]"#,
            self.datum.wkt,
            parameters.concat(),
            vertical.wkt()
        )
    }
}

/// The unit in WKT.
const METRE: &str = r#"UNIT["metre",1,AUTHORITY["EPSG","9001"]]"#;

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference coordinates from pyproj 3.7.2 (PROJ 9.5.1), `Transformer.from_crs(4979, EPSG)`.
    #[test]
    fn coordinates_of_each_family_equal_proj() {
        for (epsg, lat, lon, expected) in REFERENCE {
            let place = Geodetic::new(lat, lon, 50.0).expect("a position");
            let crs = Crs::from_epsg(epsg).expect("is supported");
            let [east, north, height] = crs.projection().expect("a projection").project(&place).expect("projects");
            assert!((east - expected[0]).hypot(north - expected[1]) < 1e-3, "EPSG:{epsg}: {east} {north}");
            assert_eq!(height, 50.0);
        }
    }

    const REFERENCE: [(u32, f64, f64, [f64; 2]); 7] = [
        (32_631, 48.846_222, 2.346_414, [452_048.210_3, 5_410_567.173_6]),
        (32_756, -33.856_8, 151.215_3, [334_900.569_7, 6_252_288.752_9]),
        (25_832, 52.5, 8.75, [483_029.246_6, 5_816_681.379_9]),
        (2154, 48.846_222, 2.346_414, [652_034.945_1, 6_860_884.820_9]),
        (3945, 45.2, 5.369_8, [1_886_158.713_0, 4_224_947.411_7]),
        (3950, 50.6, 3.06, [1_704_247.839_8, 9_266_738.113_4]),
        (3812, 50.85, 4.35, [648_679.018_0, 671_067.055_6]),
    ];

    #[test]
    fn other_systems_are_refused_with_those_that_are_supported() {
        for epsg in [0, 4326, 27_572, 32_600, 32_661, 3951] {
            let error = Crs::from_epsg(epsg).expect_err("is refused").to_string();
            assert!(error.contains(&format!("EPSG:{epsg} is not supported; use WGS 84 / UTM")), "{error}");
        }
    }

    #[test]
    fn wkt_names_system_and_height() {
        let wkt = Crs::from_epsg(32_756).expect("is supported").wkt(&VerticalDatum::Ellipsoid);
        for part in [
            r#"COMPD_CS["WGS 84 / UTM zone 56S + ellipsoidal height",PROJCS["WGS 84 / UTM zone 56S",GEOGCS["#,
            r#"PARAMETER["central_meridian",153],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",10000000],UNIT["#,
            r#"AUTHORITY["EPSG","32756"]],VERT_CS["Ellipsoid (metre)",VERT_DATUM["Ellipsoid",2002]"#,
        ] {
            assert!(wkt.contains(part), "{part}\nis not in\n{wkt}");
        }
        assert_eq!(wkt.matches('[').count(), wkt.matches(']').count());
    }
}
