//! Cross-sections of streets: cover and height by distance from the center line.

use crate::streets::paving::Paving;

/// Center of the lanes, m from the center line: traffic drives on the right, at `-LANE_T`.
pub const LANE_T: f64 = 1.6;
/// Height of a kerb, m.
pub const KERB_H: f64 = 0.14;
/// Cross slope of the road towards its edges.
const CROWN: f64 = 0.018;
/// Half the width of painted lines, m.
const LINE_HALF: f64 = 0.06;

/// Half the width of the strip of grass between the carriageways of a motorway, m.
const MEDIAN_T: f64 = 1.8;
/// Left edge of the leftmost lane of a motorway, m from its center line.
const FIRST_LANE_T: f64 = 2.5;
/// Width of its lanes, m.
const LANE_M: f64 = 3.75;
/// Width of its paved shoulder, m.
const SHOULDER_M: f64 = 2.5;
/// Half the width of its painted lines, m.
const WIDE_LINE_HALF: f64 = 0.1;
/// Period and length of the dashes between its lanes, m.
const DASH_M: [f64; 2] = [18.0, 6.0];
/// Height of its center line above the terrain, m: its edges are above the meadows.
const RAISED_M: f64 = 0.3;

/// Kind of street.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StreetKind {
    /// Between houses: two lanes, parked cars on both sides, wide sidewalks.
    Urban,
    /// Between gardens: parked cars on one side, narrow sidewalks.
    Residential,
    /// Through a village: no parking, narrow sidewalks.
    Village,
    /// Country road: edge lines, gravel shoulders, grass.
    Country,
    /// Two carriageways with a median, lanes of one direction each, and paved shoulders; grass.
    Motorway {
        /// Number of lanes in each direction.
        n_lanes: usize,
    },
}

/// A cross-section; `t` is the distance from the center line in m, positive to the left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Kind of street.
    pub kind: StreetKind,
    /// Distance from the center line to the edge of the road, m.
    pub kerb_t: f64,
    /// Distance from the center line to the objects along the street (facades, gardens, fields), m.
    pub outer_t: f64,
}

impl Profile {
    /// Street between houses, with sidewalks of the given width (m).
    pub const fn urban(walk_m: f64) -> Self {
        Self { kind: StreetKind::Urban, kerb_t: 5.2, outer_t: 5.2 + walk_m }
    }
    /// Street between gardens.
    pub const fn residential() -> Self {
        Self { kind: StreetKind::Residential, kerb_t: 4.6, outer_t: 6.8 }
    }
    /// Street through a village.
    pub const fn village() -> Self {
        Self { kind: StreetKind::Village, kerb_t: 3.8, outer_t: 5.6 }
    }
    /// Country road; its grass strips end at `outer_t`.
    pub const fn country() -> Self {
        Self { kind: StreetKind::Country, kerb_t: 3.6, outer_t: 8.0 }
    }
    /// Motorway with two carriageways of `n_lanes` each; grass up to `outer_t`.
    pub const fn motorway(n_lanes: usize) -> Self {
        let kerb_t = FIRST_LANE_T + LANE_M * n_lanes as f64 + SHOULDER_M;
        Self { kind: StreetKind::Motorway { n_lanes }, kerb_t, outer_t: kerb_t + 5.5 }
    }
    const fn is_motorway(&self) -> bool {
        matches!(self.kind, StreetKind::Motorway { .. })
    }
    /// Whether sidewalks are raised by a kerb.
    pub const fn has_kerb(&self) -> bool {
        !matches!(self.kind, StreetKind::Country | StreetKind::Motorway { .. })
    }
    /// Whether vehicles can drive at `t`.
    pub fn is_road(&self, t: f64) -> bool {
        t.abs() < self.kerb_t && (!self.is_motorway() || t.abs() > MEDIAN_T)
    }
    /// Centers of the lanes of one direction, the rightmost first, m from the center line.
    pub fn lanes_t(&self) -> Vec<f64> {
        let lines = self.lane_lines_t();
        if lines.is_empty() {
            return vec![LANE_T];
        }
        lines.windows(2).rev().map(|pair| 0.5 * (pair[0] + pair[1])).collect()
    }
    /// Lines at the sides of a motorway's lanes, m from the center line; the first and the last are solid.
    fn lane_lines_t(&self) -> Vec<f64> {
        let StreetKind::Motorway { n_lanes } = self.kind else { return Vec::new() };
        (0..=n_lanes).map(|i| FIRST_LANE_T + LANE_M * i as f64).collect()
    }
    /// Center of the cars parked on a side (1 left, -1 right), m from the center line; `None` where parking is forbidden.
    pub fn parking_t(&self, side: f64) -> Option<f64> {
        match self.kind {
            StreetKind::Urban => Some(4.15),
            StreetKind::Residential if side > 0.0 => Some(3.75),
            _ => None,
        }
    }
    /// Height of the road over the terrain, m.
    pub fn road_height(&self, t: f64) -> f64 {
        let raised_m = if self.is_motorway() { RAISED_M } else { 0.0 };
        raised_m - CROWN * t.abs().min(self.kerb_t)
    }
    /// Height above the terrain of the ground next to the road, m.
    pub fn side_height(&self, t: f64) -> f64 {
        let beyond = t.abs() - self.kerb_t;
        match self.kind {
            // A shoulder, then a ditch that ends below the meadows.
            StreetKind::Country | StreetKind::Motorway { .. } if beyond > 1.0 => {
                self.road_height(t) - 0.02 - 0.09 * (beyond - 1.0)
            }
            StreetKind::Country | StreetKind::Motorway { .. } => self.road_height(t) - 0.02 * beyond,
            _ => self.road_height(t) + KERB_H + 0.01 * beyond,
        }
    }
    /// Height of the street surface over the terrain, m.
    pub fn height(&self, t: f64) -> f64 {
        if t.abs() < self.kerb_t { self.road_height(t) } else { self.side_height(t) }
    }
    /// Cover of the ground next to the road.
    pub fn side_paving(&self, t: f64) -> Paving {
        let beyond = t.abs() - self.kerb_t;
        match self.kind {
            StreetKind::Country if beyond < 1.0 => Paving::Gravel,
            StreetKind::Country | StreetKind::Motorway { .. } => Paving::Grass,
            _ if beyond < 0.15 => Paving::Kerb,
            _ => Paving::Slab,
        }
    }
    /// Cover of the road at `t`, `s` m along the street, away from crossings.
    pub fn road_paving(&self, s: f64, t: f64) -> Paving {
        if self.is_motorway() {
            return self.motorway_paving(s, t);
        }
        let is_dash = s.rem_euclid(6.0) < 3.0;
        let is_middle = t.abs() < LINE_HALF && (is_dash || matches!(self.kind, StreetKind::Country));
        let is_edge = matches!(self.kind, StreetKind::Country) && (t.abs() - self.edge_line_t()).abs() < LINE_HALF;
        let has_middle = !matches!(self.kind, StreetKind::Residential);
        if (is_middle && has_middle) || is_edge { Paving::Paint } else { Paving::Asphalt }
    }
    fn motorway_paving(&self, s: f64, t: f64) -> Paving {
        let lines = self.lane_lines_t();
        let is_dash = s.rem_euclid(DASH_M[0]) < DASH_M[1];
        let is_painted = |i: usize| i == 0 || i + 1 == lines.len() || is_dash;
        let on_line = lines.iter().position(|line| (t.abs() - line).abs() < WIDE_LINE_HALF);
        match on_line {
            _ if !self.is_road(t) => Paving::Grass,
            Some(i) if is_painted(i) => Paving::Paint,
            _ => Paving::Asphalt,
        }
    }
    const fn edge_line_t(&self) -> f64 {
        self.kerb_t - 0.4
    }
    /// Edges of the cells across the street: paint 12 cm wide, crosswalk bars and slabs of about half a metre.
    pub fn columns(&self) -> Vec<f64> {
        if self.is_motorway() {
            return mirrored(self.motorway_columns());
        }
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
        mirrored(half)
    }
    /// Edges of the cells on one side of a motorway; each lane has three cells.
    fn motorway_columns(&self) -> Vec<f64> {
        let lines = self.lane_lines_t();
        let thirds = lines.windows(2).flat_map(|pair| [1.0, 2.0].map(|i| pair[0] + i / 3.0 * LANE_M));
        let edges = lines.iter().flat_map(|line| [line - WIDE_LINE_HALF, line + WIDE_LINE_HALF]);
        let verge = (0..5).map(|i| self.kerb_t + 0.5 + f64::from(i));
        let others = [0.5 * MEDIAN_T, MEDIAN_T, self.kerb_t - 0.5 * SHOULDER_M, self.kerb_t, self.outer_t];
        thirds.chain(edges).chain(verge).chain(others).collect()
    }
}

/// Columns of both sides, in order.
fn mirrored(mut half: Vec<f64>) -> Vec<f64> {
    half.sort_by(f64::total_cmp);
    half.iter().rev().map(|t| -t).chain(half.iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profile_columns_increase_from_edge_to_edge() {
        let others = [
            Profile::residential(),
            Profile::village(),
            Profile::country(),
            Profile::motorway(2),
            Profile::motorway(3),
        ];
        for profile in [Profile::urban(3.2)].into_iter().chain(others) {
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

    #[test]
    fn motorway_has_grass_in_the_middle_and_lines_beside_its_lanes() {
        for n_lanes in [2, 3] {
            let profile = Profile::motorway(n_lanes);
            let lanes = profile.lanes_t();
            assert_eq!(lanes.len(), n_lanes);
            assert!(lanes.iter().all(|t| profile.road_paving(3.0, -t) == Paving::Asphalt));
            assert_eq!(profile.road_paving(3.0, 1.0), Paving::Grass);
            let line = |s: f64, lane: f64, side: f64| profile.road_paving(s, lane + 0.5 * side * LANE_M);
            assert!([3.0, 9.0].iter().all(|s| line(*s, lanes[0], 1.0) == Paving::Paint), "solid on the right");
            assert_eq!([3.0, 9.0].map(|s| line(s, lanes[0], -1.0)), [Paving::Paint, Paving::Asphalt], "dashed");
            assert!(profile.height(profile.kerb_t) > 0.0 && profile.height(profile.outer_t) < -0.2);
        }
    }
}
