//! Areas of use of coordinate reference systems.

use geometry::{Geodetic, Utm};
use std::fmt;

/// How far a drive may leave the area of use of its system: degrees of latitude and of longitude.
///
/// Surveys across an edge stay in one system. The series of the projection still converge at this distance; the scale differs from 1
/// by up to 0.35 % instead of 0.1 %.
pub const MARGIN_DEG: [f64; 2] = [0.5, 2.0];

/// The area of use of a system by the EPSG registry, as a range of latitudes and longitudes.
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    latitude_deg: [f64; 2],
    /// West and east; west is larger if the area crosses the antimeridian.
    longitude_deg: [f64; 2],
    /// Number of the UTM zone. In Norway and Svalbard, zones have other edges.
    utm_zone: Option<u32>,
}

impl Area {
    /// West, south, east and north of the system with this number, degrees.
    pub(super) const fn new(epsg: u32, [west, south, east, north]: [f64; 4]) -> Self {
        let utm_zone = match epsg {
            32_601..=32_660 => Some(epsg - 32_600),
            32_701..=32_760 => Some(epsg - 32_700),
            25_828..=25_838 => Some(epsg - 25_800),
            _ => None,
        };
        Self { latitude_deg: [south, north], longitude_deg: [west, east], utm_zone }
    }

    /// Size for a comparison of areas: degrees of latitude times degrees of longitude at the equator.
    pub(super) fn square_deg(&self) -> f64 {
        let [south, north] = self.latitude_deg;
        (north - south) * self.width_deg() * f64::midpoint(south, north).to_radians().cos()
    }

    fn width_deg(&self) -> f64 {
        let [west, east] = self.longitude_deg;
        // The whole Earth has a width of 360 degrees, not 0.
        if east < west { east - west + 360.0 } else { east - west }
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
        if !(south - latitude_margin..=north + latitude_margin).contains(&place.latitude_deg) {
            return false;
        }
        let half_width = self.width_deg() / 2.0;
        // The shorter arc, which may cross the antimeridian.
        let off = place.longitude_deg - (self.longitude_deg[0] + half_width);
        let off = (off + 180.0).rem_euclid(360.0) - 180.0;
        let is_of_zone = || {
            let found = Utm::from_geodetic(place).ok().map(|utm| utm.zone());
            self.utm_zone.is_some() && found == self.utm_zone
        };
        off.abs() <= half_width + longitude_margin || is_of_zone()
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
        Crs::from_epsg(epsg).expect("is supported").area().clone()
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
            // NZCS2000, whose area crosses the antimeridian.
            (3851, -40.0, 179.0, true, true),
            (3851, -40.0, -179.0, true, true),
            (3851, -40.0, -170.0, false, true),
            (3851, -40.0, 0.0, false, false),
            // Around the pole.
            (5041, 85.0, -179.0, true, true),
            (5041, 59.6, 10.0, false, true),
            (5041, 48.0, 10.0, false, false),
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
        assert_eq!(numbers(48.846_222, 2.346_414)[..2], [32_631, 25_831]);
        assert!(numbers(48.846_222, 2.346_414).contains(&3949), "{:?}", numbers(48.846_222, 2.346_414));
        assert!(numbers(50.85, 4.35).contains(&3812), "{:?}", numbers(50.85, 4.35));
        assert_eq!(numbers(-33.86, 151.2)[0], 32_756);
        assert!(numbers(46.95, 7.44).contains(&2056), "{:?}", numbers(46.95, 7.44));
        // Grids of datums are not at hand.
        assert!(!numbers(51.5, -0.1).contains(&27_700), "{:?}", numbers(51.5, -0.1));
        assert!(numbers(85.0, 10.0).contains(&5041), "{:?}", numbers(85.0, 10.0));
    }
}
