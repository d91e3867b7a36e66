//! Cross sections of a road: edges, sidewalks, markings and height.

use super::path::STATION_M;
use super::strip::{BIN_M, Bin, N_BINS, RoadStrips, left_of_bin};

/// Distance of neighboring cross sections, stations: 5 m.
pub const SECTION_STATIONS: usize = 10;
/// Stations before and after a cross section that determine its edges and height: 2.5 m.
const EDGE_STATIONS: usize = 5;
/// Stations before and after it that determine its markings: 10 m, so that a gap between dashes does not end a marking.
const MARK_STATIONS: usize = 20;

/// A bin with fewer points is unknown.
const MIN_POINTS: u32 = 3;
/// Bins without road after which the road has ended: 0.4 m.
const END_BINS: usize = 4;
/// Unknown bins after which nothing more is known: 3 m, the shadow of a parked car.
const UNKNOWN_BINS: usize = 30;
/// Largest distance of an edge from the path, m: three lanes. Farther away, a street joins from the side.
const MAX_HALF_M: f64 = 11.0;
/// Width of a sidewalk, m, and the share of its points that are sidewalk.
const MIN_SIDEWALK_M: f64 = 0.8;
const SIDEWALK_SHARE: f64 = 0.4;
/// The kerb is searched this far from the edge that the classes give, bins.
const KERB_BINS: usize = 6;
/// The height of the road at the edge comes from the nearest of this many bins: 1 m.
const EDGE_BINS: usize = 10;
/// Height of a kerb within four bins, m.
const MIN_KERB_M: f64 = 0.05;

/// A marking covers at least this share of the stations around: dashes of 3 m and gaps of 6 m cover a third.
const MIN_COVERED: f64 = 0.2;
/// A solid line covers at least this share.
const SOLID_COVERED: f64 = 0.65;
/// Paint within this distance belongs to a marking, bins.
const MARK_BINS: usize = 2;
/// Distance of two markings, bins: 1.5 m.
const MARK_DISTANCE_BINS: usize = 15;

/// One side of a cross section. Distances to the left of the path, m; negative to the right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SideSection {
    /// Edge of the road.
    pub edge_m: f64,
    /// Whether ground that is not road was seen beyond it: otherwise the road may be wider.
    pub is_seen: bool,
    /// Outer edge of the sidewalk at the road, if there is one.
    pub sidewalk_m: Option<f64>,
    /// Height of the sidewalk or ground above the road at the edge, m; 0 if unknown.
    pub kerb_m: f64,
    /// Height of the road at the edge, m. `None` if it is unknown.
    pub height_m: Option<f64>,
}

/// Painted line along the road.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Marking {
    /// Distance to the left of the path, m.
    pub left_m: f64,
    /// Whether it has no gaps.
    pub is_solid: bool,
}

/// The road across a station.
#[derive(Clone, Debug, PartialEq)]
pub struct CrossSection {
    /// Its station.
    pub station: usize,
    /// Height of the road at the path, m. `None` without points there.
    pub height_m: Option<f64>,
    /// Right and left side. `None` where the path is on no road.
    pub sides: Option<[SideSection; 2]>,
    /// Markings from the right to the left.
    pub markings: Vec<Marking>,
}

/// Cross sections of a road every 5 m, the last one at its last station.
pub fn cross_sections(strips: &RoadStrips, road: usize) -> Vec<CrossSection> {
    let n = strips.roads()[road].stations.len();
    let Some(last) = n.checked_sub(1) else { return Vec::new() };
    let mut stations: Vec<usize> = (0..n).step_by(SECTION_STATIONS).collect();
    // A short rest belongs to the section before.
    if stations.last().is_some_and(|station| last - station < SECTION_STATIONS / 2) && stations.len() > 1 {
        stations.pop();
    }
    if stations.last() != Some(&last) {
        stations.push(last);
    }
    let around = |station: usize, reach: usize| station.saturating_sub(reach)..n.min(station + reach + 1);
    let sum = |station: usize| {
        let mut sum = vec![Bin::default(); N_BINS];
        for station in around(station, EDGE_STATIONS) {
            for (sum, bin) in sum.iter_mut().zip(strips.station(road, station)) {
                sum.kinds.iter_mut().zip(bin.kinds).for_each(|(sum, n)| *sum = sum.saturating_add(n));
                sum.height_m += bin.height_m;
            }
        }
        sum
    };
    let section = |station: usize| {
        let bins = sum(station);
        let sides = side(&bins, false).zip(side(&bins, true)).map(|(right, left)| [right, left]);
        let rows: Vec<&[Bin]> = around(station, MARK_STATIONS).map(|near| strips.station(road, near)).collect();
        let range = sides.map(|[right, left]| [right.edge_m, left.edge_m]);
        let markings = range.map_or_else(Vec::new, |range| markings(&rows, range));
        CrossSection { station, height_m: height_at_path(&bins), sides, markings }
    };
    let mut sections: Vec<CrossSection> = stations.into_iter().map(section).collect();
    smooth_edges(&mut sections);
    bridge_mouths(&mut sections);
    sections
}

/// Where a street joins from the side, the edge goes on straight between the edges before and after. The sidewalk ends there.
fn bridge_mouths(sections: &mut [CrossSection]) {
    for side in 0..2 {
        let edge = |section: &CrossSection| {
            let side = section.sides?[side];
            (side.is_seen && side.edge_m.abs() <= MAX_HALF_M).then_some(side.edge_m)
        };
        let known: Vec<Option<f64>> = sections.iter().map(edge).collect();
        for (idx, section) in sections.iter_mut().enumerate().filter(|(idx, _)| known[*idx].is_none()) {
            let Some(sides) = &mut section.sides else { continue };
            let before = (0..idx).rev().find_map(|k| Some((idx - k, known[k]?)));
            let after = (idx + 1..known.len()).find_map(|k| Some((k - idx, known[k]?)));
            let edge_m = match (before, after) {
                (Some((a, from)), Some((b, to))) => from + (to - from) * a as f64 / (a + b) as f64,
                (Some((_, only)), None) | (None, Some((_, only))) => only,
                (None, None) => sides[side].edge_m.clamp(-MAX_HALF_M, MAX_HALF_M),
            };
            sides[side] = SideSection { edge_m, is_seen: false, sidewalk_m: None, kerb_m: 0.0, height_m: None };
        }
    }
}

/// Mean height of a bin, m. `None` with few points.
fn height(bin: &Bin) -> Option<f64> {
    (bin.n() >= MIN_POINTS).then(|| bin.height_m / f64::from(bin.n()))
}

/// Height of the ground within half a meter of the path.
fn height_at_path(bins: &[Bin]) -> Option<f64> {
    let near = |bin: &usize| left_of_bin(*bin).abs() <= 0.5;
    let heights: Vec<f64> = (0..N_BINS).filter(near).filter_map(|bin| height(&bins[bin])).collect();
    (!heights.is_empty()).then(|| heights.iter().sum::<f64>() / heights.len() as f64)
}

fn road_share(bin: &Bin) -> f64 {
    f64::from(bin.kinds[0] + bin.kinds[1]) / f64::from(bin.n().max(1))
}

/// One side. `None` if the path is on no road.
fn side(bins: &[Bin], is_left: bool) -> Option<SideSection> {
    // Bins outwards from the path; `at(k)` is the k-th.
    let at = |k: usize| if is_left { N_BINS / 2 + k } else { N_BINS / 2 - 1 - k };
    let n = N_BINS / 2;
    let mut last_road = None;
    let mut first_other = None;
    let mut n_unknown = 0;
    let mut n_other = 0;
    for k in 0..n {
        let bin = &bins[at(k)];
        if bin.n() < MIN_POINTS {
            n_unknown += 1;
            if n_unknown > UNKNOWN_BINS {
                break;
            }
            continue;
        }
        n_unknown = 0;
        if road_share(bin) >= 0.5 {
            last_road = Some(k);
            first_other = None;
            n_other = 0;
        } else {
            first_other = first_other.or(Some(k));
            n_other += 1;
            if n_other >= END_BINS {
                break;
            }
        }
    }
    let last_road = last_road?;
    let is_seen = n_other >= END_BINS;
    // Between the road and the ground beyond, cars park on the road.
    let edge = first_other.filter(|_| is_seen).unwrap_or(last_road + 1);
    let kerb = kerb(bins, &at, edge);
    let edge = kerb.as_ref().map_or(edge, |kerb| kerb.bin);
    let outward = |k: usize| k as f64 * BIN_M * if is_left { 1.0 } else { -1.0 };
    let end = (edge..n).take_while(|k| {
        let bin = &bins[at(*k)];
        f64::from(bin.kinds[2]) >= SIDEWALK_SHARE * f64::from(bin.n().max(1))
    });
    let n_sidewalk = end.count();
    let sidewalk_m = (n_sidewalk as f64 * BIN_M >= MIN_SIDEWALK_M).then(|| outward(edge + n_sidewalk));
    // The edge of a kerb is exact to a bin, so the bin inside may be beyond the kerb.
    let inside = (edge.saturating_sub(EDGE_BINS)..edge.saturating_sub(1)).rev().find_map(|k| height(&bins[at(k)]));
    let kerb_m = kerb.map_or(0.0, |kerb| kerb.height_m);
    Some(SideSection { edge_m: outward(edge), is_seen, sidewalk_m, kerb_m, height_m: inside })
}

/// A step up at the edge of the road.
struct Kerb {
    /// First bin beyond it, outwards from the path.
    bin: usize,
    height_m: f64,
}

/// The highest step near an edge.
fn kerb(bins: &[Bin], at: &impl Fn(usize) -> usize, edge: usize) -> Option<Kerb> {
    let height = |k: usize| (k < N_BINS / 2).then(|| height(&bins[at(k)])).flatten();
    let steps = (edge.saturating_sub(KERB_BINS)..edge + KERB_BINS).filter_map(|k| {
        let inside = height(k.checked_sub(2)?)?;
        let outside = height(k + 1)?;
        Some(Kerb { bin: k, height_m: outside - inside })
    });
    steps.max_by(|a, b| a.height_m.total_cmp(&b.height_m)).filter(|kerb| kerb.height_m >= MIN_KERB_M)
}

/// Markings between two edges, from the stations around a cross section.
fn markings(stations: &[&[Bin]], [right_m, left_m]: [f64; 2]) -> Vec<Marking> {
    let has_paint: Vec<Vec<bool>> = stations
        .iter()
        .map(|bins| bins.iter().map(|bin| bin.kinds[1] > 0 && 3 * bin.kinds[1] >= bin.kinds[0]).collect())
        .collect();
    let covered = |bin: usize| {
        let range = bin.saturating_sub(MARK_BINS)..(bin + MARK_BINS + 1).min(N_BINS);
        let n = has_paint.iter().filter(|paint| paint[range.clone()].contains(&true)).count();
        n as f64 / stations.len() as f64
    };
    let is_inside = |bin: &usize| (right_m..=left_m).contains(&left_of_bin(*bin));
    let mut found: Vec<(usize, f64)> = (0..N_BINS).filter(is_inside).map(|bin| (bin, covered(bin))).collect();
    found.retain(|(_, covered)| *covered >= MIN_COVERED);
    found.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut chosen: Vec<(usize, f64)> = Vec::new();
    for (bin, covered) in found {
        if chosen.iter().all(|(other, _)| other.abs_diff(bin) >= MARK_DISTANCE_BINS) {
            chosen.push((bin, covered));
        }
    }
    chosen.sort_by_key(|(bin, _)| *bin);
    let marking = |(bin, covered): (usize, f64)| {
        let range = bin.saturating_sub(2 * MARK_BINS)..(bin + 2 * MARK_BINS + 1).min(N_BINS);
        let counts: Vec<f64> =
            range.clone().map(|bin| has_paint.iter().filter(|paint| paint[bin]).count() as f64).collect();
        let sum: f64 = counts.iter().sum();
        let left_m = range.zip(&counts).map(|(bin, n)| n * left_of_bin(bin)).sum::<f64>() / sum.max(1.0);
        Marking { left_m, is_solid: covered >= SOLID_COVERED }
    };
    chosen.into_iter().map(marking).collect()
}

/// Edges become the median of three neighbors: a driveway or a car hides the kerb of one.
fn smooth_edges(sections: &mut [CrossSection]) {
    let edges: Vec<Option<[SideSection; 2]>> = sections.iter().map(|section| section.sides).collect();
    for (idx, section) in sections.iter_mut().enumerate() {
        let Some(sides) = &mut section.sides else { continue };
        let around = idx.saturating_sub(1)..(idx + 2).min(edges.len());
        for (number, side) in sides.iter_mut().enumerate() {
            let mut near: Vec<SideSection> =
                edges[around.clone()].iter().flatten().map(|sides| sides[number]).collect();
            near.sort_by(|a, b| a.edge_m.total_cmp(&b.edge_m));
            if near.len() == 3 {
                // The height is the one here: streets climb.
                *side = SideSection { height_m: side.height_m.or(near[1].height_m), ..near[1] };
            }
        }
    }
}

/// Distance along the road of a cross section from its first station, m.
pub fn along_m(section: &CrossSection) -> f64 {
    section.station as f64 * STATION_M
}

#[cfg(test)]
pub(in crate::road) mod tests {
    use super::*;
    use crate::removal::tests::point;
    use crate::road::{DrivenRoad, Station};
    use messages::ClassId;

    /// A straight road to the east from -3.5 to 4 m, sidewalks of 2 m behind kerbs of 12 cm, a solid line at 0.25 and a broken one at -3 m
    /// (3 m of 9), a hidden strip under cars parked at the left kerb.
    pub(in crate::road) fn street(length_m: usize) -> RoadStrips {
        let stations = (0..2 * length_m).map(|k| Station { place: [0.5 * k as f64, 0.0], direction: [1.0, 0.0] });
        let mut strips = RoadStrips::new(vec![DrivenRoad { stations: stations.collect() }]);
        for x in (0..length_m * 8).map(|k| k as f64 / 8.0) {
            for y in (-70..80).map(|k| f64::from(k) * 0.1 + 0.05) {
                let is_road = (-3.5..4.0).contains(&y);
                let is_hidden = (2.0..4.0).contains(&y) && (20.0..60.0).contains(&x);
                let is_paint = (y - 0.25).abs() < 0.08 || (y + 3.0).abs() < 0.08 && x % 9.0 < 3.0;
                let class = match y {
                    _ if is_hidden => continue,
                    _ if is_paint => ClassId::RoadLine,
                    _ if is_road => ClassId::Road,
                    y if (-5.5..6.0).contains(&y) => ClassId::Sidewalk,
                    _ => ClassId::Terrain,
                };
                strips.add(&point(class, [x, y, 0.01 * x + if is_road { 0.0 } else { 0.12 }]));
            }
        }
        strips
    }

    #[test]
    fn edges_sidewalks_and_markings_of_a_street_are_found() {
        let strips = street(80);
        let sections = cross_sections(&strips, 0);
        assert_eq!(sections.len(), 17);
        for section in &sections[1..sections.len() - 1] {
            let [right, left] = section.sides.expect("on a road");
            assert!((right.edge_m + 3.5).abs() < 0.11 && (left.edge_m - 4.0).abs() < 0.11, "{section:?}");
            assert!(right.is_seen && left.is_seen && (right.kerb_m - 0.12).abs() < 0.02, "{section:?}");
            assert!((right.sidewalk_m.expect("a sidewalk") + 5.5).abs() < 0.11);
            let height = section.height_m.expect("was seen");
            assert!((height - 0.01 * along_m(section)).abs() < 0.01, "{height}");
            let [broken, solid] = &section.markings[..] else { panic!("{section:?}") };
            assert!((broken.left_m + 3.0).abs() < 0.06 && !broken.is_solid, "{section:?}");
            assert!((solid.left_m - 0.25).abs() < 0.06 && solid.is_solid, "{section:?}");
        }
    }

    #[test]
    fn edge_goes_straight_on_past_the_mouth_of_a_street() {
        let seen = |edge_m: f64| SideSection {
            edge_m,
            is_seen: true,
            sidewalk_m: Some(edge_m + 2.0),
            kerb_m: 0.1,
            height_m: None,
        };
        let section = |(idx, left): (usize, SideSection)| CrossSection {
            station: 10 * idx,
            height_m: None,
            sides: Some([seen(-3.0), left]),
            markings: Vec::new(),
        };
        let unseen = SideSection { is_seen: false, ..seen(19.9) };
        let lefts = [unseen, seen(4.0), seen(15.0), unseen, seen(5.5), seen(5.6)];
        let mut sections: Vec<CrossSection> = lefts.into_iter().enumerate().map(section).collect();
        bridge_mouths(&mut sections);
        let edges: Vec<f64> = sections.iter().filter_map(|section| Some(section.sides?[1].edge_m)).collect();
        assert_eq!(edges, [4.0, 4.0, 4.5, 5.0, 5.5, 5.6]);
        assert_eq!(sections[2].sides.expect("on a road")[1].sidewalk_m, None);
        assert!(sections.iter().all(|section| section.sides.is_some_and(|[right, _]| right.is_seen)));
    }

    #[test]
    fn path_on_grass_has_no_sides() {
        let stations = (0..40).map(|k| Station { place: [0.5 * f64::from(k), 0.0], direction: [1.0, 0.0] });
        let mut strips = RoadStrips::new(vec![DrivenRoad { stations: stations.collect() }]);
        for (x, y) in (0..200).flat_map(|x| (-50..50).map(move |y| (f64::from(x) * 0.1, f64::from(y) * 0.1))) {
            strips.add(&point(ClassId::Terrain, [x, y, 3.0]));
        }
        let sections = cross_sections(&strips, 0);
        assert!(sections.iter().all(|section| section.sides.is_none() && section.markings.is_empty()));
    }
}
