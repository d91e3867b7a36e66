//! Lanes between the markings and edges of cross sections.

use super::cross_section::{CrossSection, SideSection, along_m};

/// A marking this near to an edge is the line along the edge, m.
const EDGE_LINE_M: f64 = 1.0;
/// A wider strip without markings has several lanes, m, each of about this width.
const MAX_LANE_M: f64 = 5.0;
const LANE_M: f64 = 3.25;
/// Boundaries of neighboring cross sections are one line if they differ by less, m.
const SAME_LINE_M: f64 = 0.7;
/// Least width of a lane where it ends, m.
const MIN_LANE_M: f64 = 0.1;
/// Half of a lane, m: the boundary to the left of the path is farther away than the wheels of the vehicle.
const WHEELS_M: f64 = 0.5;

/// The side on which one drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Traffic {
    /// The rule on the European continent.
    #[default]
    Right,
    /// The rule in Britain.
    Left,
}

/// Paint of a boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// No paint.
    None,
    /// With gaps.
    Broken,
    /// Without gaps.
    Solid,
    /// A kerb or the edge of the road.
    Edge,
}

/// A line between lanes at the cross sections of a lane section.
#[derive(Clone, Debug, PartialEq)]
pub struct Boundary {
    /// Distance to the left of the path at each cross section, m.
    pub left_m: Vec<f64>,
    /// Its paint.
    pub mark: Mark,
}

/// Use of a lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LaneKind {
    /// For vehicles.
    Driving,
    /// For people, at this height above the road, mm.
    Sidewalk {
        /// Height of the kerb, mm.
        kerb_mm: i32,
    },
}

/// A lane between two neighboring boundaries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lane {
    /// Number by OpenDRIVE: negative to the right of the center, positive to the left.
    pub id: i32,
    /// Its use.
    pub kind: LaneKind,
    /// Index of its boundary that is nearer to the center, and of the other one.
    pub inner: usize,
    /// Index of its outer boundary.
    pub outer: usize,
}

/// A part of a road with the same lanes.
#[derive(Clone, Debug, PartialEq)]
pub struct LaneSection {
    /// Distances of its cross sections along the road, m, from the first station. At least two, except for a section of one place.
    pub along_m: Vec<f64>,
    /// Boundaries from the right to the left.
    pub boundaries: Vec<Boundary>,
    /// Index of the boundary between the directions.
    pub center: usize,
    /// Lanes from the right to the left.
    pub lanes: Vec<Lane>,
}

/// Boundaries at one cross section.
struct Profile {
    along_m: f64,
    lines: Vec<Line>,
    kerb_mm: [i32; 2],
}

#[derive(Clone, Copy)]
struct Line {
    left_m: f64,
    role: Role,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Role {
    OuterSidewalk,
    Edge,
    Painted { is_solid: bool },
    Unpainted,
}

/// Lane sections of a road. Parts where the path is on no road are left out: each run of cross sections with edges is a list of its own.
pub fn lane_sections(sections: &[CrossSection], traffic: Traffic) -> Vec<Vec<LaneSection>> {
    let runs = sections.split(|section| section.sides.is_none()).filter(|run| run.len() > 1);
    runs.map(|run| sections_of_run(&run.iter().filter_map(profile).collect::<Vec<_>>(), traffic)).collect()
}

fn profile(section: &CrossSection) -> Option<Profile> {
    let [right, left] = section.sides?;
    let edge = |left_m: f64| Line { left_m, role: Role::Edge };
    let mut inner = vec![edge(right.edge_m)];
    for marking in &section.markings {
        if marking.left_m - right.edge_m > EDGE_LINE_M && left.edge_m - marking.left_m > EDGE_LINE_M {
            inner.push(Line { left_m: marking.left_m, role: Role::Painted { is_solid: marking.is_solid } });
        }
    }
    inner.push(edge(left.edge_m));
    let mut lines: Vec<Line> = right.sidewalk_m.map(outer_sidewalk).into_iter().collect();
    for pair in inner.windows(2) {
        lines.push(pair[0]);
        let width_m = pair[1].left_m - pair[0].left_m;
        let n = if width_m > MAX_LANE_M { (width_m / LANE_M).round() as u32 } else { 1 };
        let between = (1..n).map(|k| pair[0].left_m + width_m * f64::from(k) / f64::from(n));
        lines.extend(between.map(|left_m| Line { left_m, role: Role::Unpainted }));
    }
    lines.extend(inner.last());
    lines.extend(left.sidewalk_m.map(outer_sidewalk));
    let kerb_mm = [right, left].map(|side: SideSection| (1000.0 * side.kerb_m).round() as i32);
    Some(Profile { along_m: along_m(section), lines, kerb_mm })
}

fn outer_sidewalk(left_m: f64) -> Line {
    Line { left_m, role: Role::OuterSidewalk }
}

/// Whether two cross sections have the same lanes.
fn continues(a: &Profile, b: &Profile) -> bool {
    let is_same = |(a, b): (&Line, &Line)| {
        let is_edge = |line: &Line| matches!(line.role, Role::Edge | Role::OuterSidewalk);
        is_edge(a) == is_edge(b) && (is_edge(a) || (a.left_m - b.left_m).abs() < SAME_LINE_M)
    };
    a.lines.len() == b.lines.len() && a.lines.iter().zip(&b.lines).all(is_same)
}

fn sections_of_run(profiles: &[Profile], traffic: Traffic) -> Vec<LaneSection> {
    let chunks: Vec<&[Profile]> = profiles.chunk_by(continues).collect();
    let mut found: Vec<LaneSection> = chunks.iter().map(|chunk| section(chunk, traffic)).collect();
    // A section ends where the next one starts. Boundaries that go on meet there.
    for number in 1..found.len() {
        let (before, after) = found.split_at_mut(number);
        let (Some(section), Some(next)) = (before.last_mut(), after.first()) else { continue };
        section.along_m.extend(next.along_m.first());
        let ends = ends(section, next);
        for (boundary, end_m) in section.boundaries.iter_mut().zip(ends) {
            boundary.left_m.push(end_m);
        }
    }
    // A single cross section at the end has no length: the section before ends there.
    found.retain(|section| section.along_m.len() > 1);
    found
}

/// Places where the boundaries of a section end: where the next section has a line of their kind nearby, else where they are. All stay
/// where they are if they would cross.
fn ends(section: &LaneSection, next: &LaneSection) -> Vec<f64> {
    let last = |boundary: &Boundary| boundary.left_m.last().copied().unwrap_or_default();
    let end = |boundary: &Boundary| {
        let last_m = last(boundary);
        let is_like = |other: &&Boundary| (other.mark == Mark::Edge) == (boundary.mark == Mark::Edge);
        let starts = next.boundaries.iter().filter(is_like).filter_map(|other| other.left_m.first().copied());
        let nearest = starts.min_by(|a, b| (a - last_m).abs().total_cmp(&(b - last_m).abs()));
        nearest.filter(|at| (at - last_m).abs() < SAME_LINE_M).unwrap_or(last_m)
    };
    let ends: Vec<f64> = section.boundaries.iter().map(end).collect();
    let is_ordered = ends.windows(2).all(|pair| pair[1] - pair[0] > MIN_LANE_M);
    if is_ordered { ends } else { section.boundaries.iter().map(last).collect() }
}

fn section(profiles: &[Profile], traffic: Traffic) -> LaneSection {
    let n = profiles[0].lines.len();
    let boundary = |k: usize| {
        let lines = || profiles.iter().map(|profile| profile.lines[k]);
        let n_painted = lines().filter(|line| matches!(line.role, Role::Painted { .. })).count();
        let n_solid = lines().filter(|line| line.role == Role::Painted { is_solid: true }).count();
        let mark = match lines().next().map(|line| line.role) {
            Some(Role::Edge | Role::OuterSidewalk) | None => Mark::Edge,
            _ if 2 * n_painted < profiles.len() => Mark::None,
            _ if 2 * n_solid > n_painted => Mark::Solid,
            _ => Mark::Broken,
        };
        Boundary { left_m: lines().map(|line| line.left_m).collect(), mark }
    };
    let boundaries: Vec<Boundary> = (0..n).map(boundary).collect();
    let center = center(&boundaries, &profiles[0].lines, traffic);
    let kerb_mm = |side: usize| {
        let mut kerbs: Vec<i32> = profiles.iter().map(|profile| profile.kerb_mm[side]).collect();
        kerbs.sort_unstable();
        kerbs[kerbs.len() / 2]
    };
    let lane = |k: usize| {
        let is_right = k < center;
        let id = if is_right { k as i32 - center as i32 } else { (k - center) as i32 + 1 };
        let is_sidewalk = [k, k + 1].iter().any(|line| profiles[0].lines[*line].role == Role::OuterSidewalk);
        let kind = if is_sidewalk {
            LaneKind::Sidewalk { kerb_mm: kerb_mm(usize::from(!is_right)) }
        } else {
            LaneKind::Driving
        };
        let [inner, outer] = if is_right { [k + 1, k] } else { [k, k + 1] };
        Lane { id, kind, inner, outer }
    };
    LaneSection {
        along_m: profiles.iter().map(|profile| profile.along_m).collect(),
        lanes: (0..n - 1).map(lane).collect(),
        boundaries,
        center,
    }
}

/// The boundary between the directions: the nearest one on the side of the oncoming traffic, beyond the wheels of the vehicle, which drives
/// in the lane at the center.
fn center(boundaries: &[Boundary], lines: &[Line], traffic: Traffic) -> usize {
    let mean = |boundary: &Boundary| boundary.left_m.iter().sum::<f64>() / boundary.left_m.len().max(1) as f64;
    let is_of_road = |k: &usize| lines[*k].role != Role::OuterSidewalk;
    let of_road: Vec<usize> = (0..boundaries.len()).filter(is_of_road).collect();
    let is_beyond = |k: &usize| match traffic {
        Traffic::Right => mean(&boundaries[*k]) > WHEELS_M,
        Traffic::Left => mean(&boundaries[*k]) < -WHEELS_M,
    };
    let found = match traffic {
        Traffic::Right => of_road.iter().copied().find(is_beyond).or(of_road.last().copied()),
        Traffic::Left => of_road.iter().copied().rev().find(is_beyond).or(of_road.first().copied()),
    };
    found.unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::cross_section::Marking;

    fn section(station: usize, edges: [f64; 2], markings: &[(f64, bool)]) -> CrossSection {
        let side =
            |edge_m: f64, sidewalk_m| SideSection { edge_m, is_seen: true, sidewalk_m, kerb_m: 0.12, height_m: None };
        CrossSection {
            station,
            height_m: Some(0.0),
            sides: Some([side(edges[0], Some(edges[0] - 2.0)), side(edges[1], None)]),
            markings: markings.iter().map(|&(left_m, is_solid)| Marking { left_m, is_solid }).collect(),
        }
    }

    #[test]
    fn lanes_lie_between_edges_and_markings() {
        let markings = [(-2.9, true), (1.6, false)];
        let sections: Vec<CrossSection> = (0..5).map(|k| section(10 * k, [-3.2, 4.9], &markings)).collect();
        let runs = lane_sections(&sections, Traffic::Right);
        let [run] = &runs[..] else { panic!("{runs:?}") };
        let [lanes] = &run[..] else { panic!("{run:?}") };
        // Outer edge of the sidewalk, kerb, center line, kerb; the line at the right edge is not a boundary.
        assert_eq!(lanes.boundaries.iter().map(|b| b.left_m[0]).collect::<Vec<_>>(), [-5.2, -3.2, 1.6, 4.9]);
        assert_eq!((lanes.center, lanes.boundaries[2].mark), (2, Mark::Broken));
        let ids: Vec<(i32, LaneKind)> = lanes.lanes.iter().map(|lane| (lane.id, lane.kind)).collect();
        let sidewalk = LaneKind::Sidewalk { kerb_mm: 120 };
        assert_eq!(ids, [(-2, sidewalk), (-1, LaneKind::Driving), (1, LaneKind::Driving)]);
        let left = lane_sections(&sections, Traffic::Left);
        // The vehicle drives at the left: the center is to its right.
        assert_eq!(left[0][0].center, 1);
    }

    #[test]
    fn boundaries_that_would_cross_end_where_they_are() {
        let boundary = |left_m: f64| Boundary { left_m: vec![left_m], mark: Mark::None };
        let with = |lines: &[f64]| LaneSection {
            along_m: vec![0.0],
            boundaries: lines.iter().copied().map(boundary).collect(),
            center: 0,
            lanes: Vec::new(),
        };
        assert_eq!(ends(&with(&[-3.0, 0.0, 3.0]), &with(&[-2.8, 0.9, 3.1])), [-2.8, 0.0, 3.1]);
        assert_eq!(ends(&with(&[-3.0, -2.5, 3.0]), &with(&[-2.7, 3.1])), [-3.0, -2.5, 3.0]);
    }

    #[test]
    fn wide_road_without_paint_has_several_lanes_and_changes_make_sections() {
        let mut sections: Vec<CrossSection> = (0..4).map(|k| section(10 * k, [-3.2, 3.4], &[])).collect();
        sections.extend((4..8).map(|k| section(10 * k, [-3.2, 6.8], &[])));
        sections.push(CrossSection { sides: None, ..section(80, [0.0; 2], &[]) });
        let runs = lane_sections(&sections, Traffic::Right);
        let [run] = &runs[..] else { panic!("{runs:?}") };
        let n_driving = |section: &LaneSection| section.lanes.iter().filter(|l| l.kind == LaneKind::Driving).count();
        assert_eq!(run.iter().map(n_driving).collect::<Vec<_>>(), [2, 3]);
        assert_eq!(run[0].along_m.last(), run[1].along_m.first());
        assert!(run[0].boundaries.iter().all(|boundary| boundary.left_m.len() == run[0].along_m.len()));
    }
}
