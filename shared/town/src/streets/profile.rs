//! Cross-sections of streets: cover and height by distance from the center line.

use crate::streets::paving::Paving;

/// Middle of the lanes, m from the center line: drive on the right, that is at `-LANE_T`.
pub const LANE_T: f64 = 1.6;
/// Height of a kerb, m.
pub const KERB_H: f64 = 0.14;
/// The road falls to its edges by this slope.
const CROWN: f64 = 0.018;
/// Half the width of painted lines, m.
const LINE_HALF: f64 = 0.06;

/// Kind of street.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StreetKind {
    /// Between houses: two lanes, parked cars on both sides, wide sidewalks.
    Urban,
    /// Between gardens: parked cars on one side, narrow sidewalks.
    Residential,
    /// Through a village: no parking, narrow sidewalks.
    Village,
    /// Over land: edge lines, gravel shoulders, grass.
    Country,
}

/// A cross-section; `t` is the distance from the center line in m, positive to the left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Kind of street.
    pub kind: StreetKind,
    /// From the center line to the edge of the road, m.
    pub kerb_t: f64,
    /// To what stands beside the street (facades, gardens, fields), m.
    pub outer_t: f64,
}

impl Profile {
    /// With sidewalks of the given width (m) between houses.
    pub const fn urban(walk_m: f64) -> Self {
        Self { kind: StreetKind::Urban, kerb_t: 5.2, outer_t: 5.2 + walk_m }
    }
    /// Between gardens.
    pub const fn residential() -> Self {
        Self { kind: StreetKind::Residential, kerb_t: 4.6, outer_t: 6.8 }
    }
    /// Through a village.
    pub const fn village() -> Self {
        Self { kind: StreetKind::Village, kerb_t: 3.8, outer_t: 5.6 }
    }
    /// Over land: its grass strips end at `outer_t`.
    pub const fn country() -> Self {
        Self { kind: StreetKind::Country, kerb_t: 3.6, outer_t: 8.0 }
    }
    /// Whether sidewalks are raised by a kerb.
    pub const fn has_kerb(&self) -> bool {
        !matches!(self.kind, StreetKind::Country)
    }
    /// Middle of the cars parked on a side (1 left, -1 right), m from the center line; `None` where parking is forbidden.
    pub fn parking_t(&self, side: f64) -> Option<f64> {
        match self.kind {
            StreetKind::Urban => Some(4.15),
            StreetKind::Residential if side > 0.0 => Some(3.75),
            _ => None,
        }
    }
    /// Height of the road over the terrain, m.
    pub fn road_height(&self, t: f64) -> f64 {
        -CROWN * t.abs().min(self.kerb_t)
    }
    /// Height of what lies beside the road over the terrain, m.
    pub fn side_height(&self, t: f64) -> f64 {
        let beyond = t.abs() - self.kerb_t;
        match self.kind {
            // A shoulder, then a ditch that ends below the meadows.
            StreetKind::Country if beyond > 1.0 => self.road_height(t) - 0.02 - 0.09 * (beyond - 1.0),
            StreetKind::Country => self.road_height(t) - 0.02 * beyond,
            _ => self.road_height(t) + KERB_H + 0.01 * beyond,
        }
    }
    /// Height of the street surface over the terrain, m.
    pub fn height(&self, t: f64) -> f64 {
        if t.abs() < self.kerb_t { self.road_height(t) } else { self.side_height(t) }
    }
    /// What covers the ground beside the road.
    pub fn side_paving(&self, t: f64) -> Paving {
        let beyond = t.abs() - self.kerb_t;
        match self.kind {
            StreetKind::Country if beyond < 1.0 => Paving::Gravel,
            StreetKind::Country => Paving::Grass,
            _ if beyond < 0.15 => Paving::Kerb,
            _ => Paving::Slab,
        }
    }
    /// What covers the road at `t`, `s` m along the street, away from crossings.
    pub fn road_paving(&self, s: f64, t: f64) -> Paving {
        let is_dash = s.rem_euclid(6.0) < 3.0;
        let is_middle = t.abs() < LINE_HALF && (is_dash || matches!(self.kind, StreetKind::Country));
        let is_edge = matches!(self.kind, StreetKind::Country) && (t.abs() - self.edge_line_t()).abs() < LINE_HALF;
        let has_middle = !matches!(self.kind, StreetKind::Residential);
        if (is_middle && has_middle) || is_edge { Paving::Paint } else { Paving::Asphalt }
    }
    const fn edge_line_t(&self) -> f64 {
        self.kerb_t - 0.4
    }
    /// Edges of the cells across the street: paint 12 cm wide, crosswalk bars and slabs of about half a metre.
    pub fn columns(&self) -> Vec<f64> {
        let mut half = vec![LINE_HALF, self.kerb_t];
        let n = (self.kerb_t / 0.5) as usize;
        half.extend((1..=n).map(|i| 0.5 * i as f64).filter(|t| self.kerb_t - t > 0.2));
        if matches!(self.kind, StreetKind::Country) {
            let line = self.edge_line_t();
            half.retain(|t| (t - line).abs() > 0.2);
            half.extend([line - LINE_HALF, line + LINE_HALF, self.kerb_t + 1.0]);
        } else {
            half.push(self.kerb_t + 0.15);
        }
        let walk = self.outer_t - self.kerb_t;
        half.extend(
            (1..=(walk / 0.8) as usize).map(|i| self.kerb_t + 0.4 + 0.8 * i as f64).filter(|t| *t < self.outer_t - 0.2),
        );
        half.push(self.outer_t);
        half.sort_by(f64::total_cmp);
        half.iter().rev().map(|t| -t).chain(half.iter().copied()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profile_columns_increase_from_edge_to_edge() {
        for profile in [Profile::urban(3.2), Profile::residential(), Profile::village(), Profile::country()] {
            let columns = profile.columns();
            assert!(columns.windows(2).all(|pair| pair[1] - pair[0] > 0.04), "{columns:?}");
            assert_eq!((columns[0], columns[columns.len() - 1]), (-profile.outer_t, profile.outer_t));
            assert!(columns.contains(&profile.kerb_t) && columns.contains(&-profile.kerb_t));
        }
    }

    #[test]
    fn urban_kerb_is_a_step_and_country_road_has_none() {
        let step = |p: &Profile| p.height(p.kerb_t + 0.01) - p.height(p.kerb_t - 0.01);
        assert!((step(&Profile::urban(3.0)) - KERB_H).abs() < 0.001);
        assert!(step(&Profile::country()).abs() < 0.001);
    }

    #[test]
    fn center_line_is_dashed_and_country_edge_line_is_solid() {
        let urban = Profile::urban(3.2);
        assert_eq!([urban.road_paving(1.0, 0.0), urban.road_paving(4.0, 0.0)], [Paving::Paint, Paving::Asphalt]);
        let country = Profile::country();
        assert!((0..12).all(|s| country.road_paving(f64::from(s), 3.2) == Paving::Paint));
        assert_eq!(country.road_paving(1.0, 2.0), Paving::Asphalt);
    }
}
