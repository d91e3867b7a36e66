//! Areas of use of coordinate reference systems.

use geometry::{Geodetic, Utm};
use std::fmt;

/// How far a drive may leave the area of use of its system: degrees of latitude and of longitude.
///
/// Surveys across an edge stay in one system. The series of the projection still converge at this distance; the scale differs from 1
/// by up to 0.35 % instead of 0.1 %.
pub const MARGIN_DEG: [f64; 2] = [0.5, 2.0];

/// The area of use of a system by the EPSG registry (version 11.022), as a range of latitudes and longitudes.
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    latitude_deg: [f64; 2],
    /// West and east; west is smaller.
    longitude_deg: [f64; 2],
    /// Number of the UTM zone on WGS84, and whether it is in the north. In Norway and Svalbard, zones have other edges.
    utm: Option<(u32, bool)>,
}

/// West, south, east and north of RGF93 v1 / CC42 to CC50, degrees.
const CONIC_ZONES: [[f64; 4]; 9] = [
    [-1.06, 41.31, 9.63, 43.07],
    [-1.79, 42.33, 7.65, 44.01],
    [-1.79, 42.92, 7.71, 45.0],
    [-1.46, 44.0, 7.71, 46.0],
    [-2.21, 45.0, 7.16, 47.0],
    [-4.77, 46.0, 7.63, 48.0],
    [-4.87, 47.0, 8.23, 49.0],
    [-4.87, 48.0, 8.23, 50.0],
    [-2.03, 49.0, 8.08, 51.14],
];
/// Southernmost latitude of ETRS89, degrees. The registry restricts some zones further, to the countries that use them.
const ETRS89_SOUTH: f64 = 34.0;

impl Area {
    /// The area of a supported system.
    pub(super) fn from_epsg(epsg: u32) -> Self {
        let zone = |zone: u32| [f64::from(zone) * 6.0 - 186.0, f64::from(zone) * 6.0 - 180.0];
        let area = |[west, south, east, north]: [f64; 4]| Self {
            latitude_deg: [south, north],
            longitude_deg: [west, east],
            utm: None,
        };
        match epsg {
            32_601..=32_660 => {
                Self { latitude_deg: [0.0, 84.0], longitude_deg: zone(epsg - 32_600), utm: Some((epsg - 32_600, true)) }
            }
            32_701..=32_760 => Self {
                latitude_deg: [-80.0, 0.0],
                longitude_deg: zone(epsg - 32_700),
                utm: Some((epsg - 32_700, false)),
            },
            25_828..=25_838 => Self {
                latitude_deg: [ETRS89_SOUTH, 84.0],
                longitude_deg: zone(epsg - 25_800),
                utm: Some((epsg - 25_800, true)),
            },
            3942..=3950 => area(CONIC_ZONES[(epsg - 3942) as usize]),
            3812 => area([2.5, 49.5, 6.4, 51.51]),
            // Lambert-93.
            _ => area([-9.86, 41.15, 10.38, 51.56]),
        }
    }

    /// Whether a position is in the area.
    pub fn contains(&self, place: &Geodetic) -> bool {
        self.is_within(place, [0.0; 2])
    }

    /// Whether a position is in the area or at most [`MARGIN_DEG`] outside.
    pub fn contains_with_margin(&self, place: &Geodetic) -> bool {
        self.is_within(place, MARGIN_DEG)
    }

    fn is_within(&self, place: &Geodetic, [latitude_margin, longitude_margin]: [f64; 2]) -> bool {
        let [south, north] = self.latitude_deg;
        let [west, east] = self.longitude_deg;
        if !(south - latitude_margin..=north + latitude_margin).contains(&place.latitude_deg) {
            return false;
        }
        // The shorter arc, which may cross the antimeridian.
        let off = place.longitude_deg - f64::midpoint(west, east);
        let off = (off + 180.0).rem_euclid(360.0) - 180.0;
        let is_of_zone = || {
            let found = Utm::from_geodetic(place).ok().map(|utm| utm.zone());
            self.utm.is_some_and(|(zone, _)| found == Some(zone))
        };
        off.abs() <= (east - west) / 2.0 + longitude_margin || is_of_zone()
    }
}

impl fmt::Display for Area {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [south, north] = self.latitude_deg;
        let [west, east] = self.longitude_deg;
        write!(f, "latitude {south} to {north}, longitude {west} to {east}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crs::Crs;

    fn place(lat: f64, lon: f64) -> Geodetic {
        Geodetic::new(lat, lon, 0.0).expect("a position")
    }

    fn area(epsg: u32) -> Area {
        Crs::from_epsg(epsg).expect("is supported").area()
    }

    #[test]
    fn every_utm_zone_contains_only_places_of_its_own() {
        for zone in 1..=60 {
            let lon = f64::from(zone) * 6.0 - 183.0;
            for (lat, own) in [(45.0, 32_600 + zone), (-45.0, 32_700 + zone)] {
                let holding: Vec<u32> = (32_601..=32_660)
                    .chain(32_701..=32_760)
                    .filter(|epsg| area(*epsg).contains_with_margin(&place(lat, lon)))
                    .collect();
                assert_eq!(holding, [own], "{lat} {lon}");
            }
        }
    }

    #[test]
    fn zones_of_norway_and_svalbard_contain_their_places() {
        for (lat, lon) in [(60.39, 5.32), (60.39, 3.1), (78.22, 15.65), (78.0, 9.5), (78.0, 21.5), (83.9, 33.5)] {
            let place = place(lat, lon);
            let crs = Crs::utm_of(&place).expect("has a zone");
            assert!(crs.area().contains(&place), "{lat} {lon} EPSG:{}", crs.epsg());
        }
    }

    #[test]
    fn margin_is_two_degrees_of_longitude_and_half_a_degree_of_latitude() {
        for (epsg, lat, lon, is_inside, is_near) in [
            (25_832, 48.6, 13.8, false, true),
            (25_832, 48.6, 14.1, false, false),
            (32_631, 48.85, 2.35, true, true),
            (32_630, 48.85, 2.35, false, false),
            (32_731, 0.4, 2.0, false, true),
            (32_731, 0.6, 2.0, false, false),
            // Both sides of the antimeridian.
            (32_660, -0.1, -178.5, false, true),
            (32_601, 10.0, 178.5, false, true),
            (32_601, 10.0, 177.5, false, false),
            (2154, 48.85, 2.35, true, true),
            (2154, 52.5, 2.35, false, false),
            (3949, 48.85, 2.35, true, true),
            (3943, 48.85, 2.35, false, false),
            (3812, 48.85, 2.35, false, false),
            (3812, 49.3, 4.0, false, true),
        ] {
            let place = place(lat, lon);
            let found = (area(epsg).contains(&place), area(epsg).contains_with_margin(&place));
            assert_eq!(found, (is_inside, is_near), "EPSG:{epsg} {lat} {lon}");
        }
    }

    #[test]
    fn systems_of_a_place_are_listed_with_utm_first() {
        let numbers =
            |lat: f64, lon: f64| -> Vec<u32> { Crs::containing(&place(lat, lon)).iter().map(Crs::epsg).collect() };
        assert_eq!(numbers(48.846_222, 2.346_414), [32_631, 25_831, 2154, 3948, 3949]);
        assert_eq!(numbers(50.85, 4.35), [32_631, 25_831, 2154, 3950, 3812]);
        assert_eq!(numbers(-33.86, 151.2), [32_756]);
        assert!(numbers(85.0, 10.0).is_empty());
    }
}
