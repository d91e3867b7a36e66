//! Kerbs, edges and markings of the driven streets as lines.

use super::cross_section::{CrossSection, SideSection, cross_sections};
use super::lanes::{Mark, Traffic, lane_sections};
use super::path::{STATION_M, Station};
use super::strip::RoadStrips;

/// Lines of neighboring lane sections are one line if their ends are nearer than this, m.
const SAME_END_M: f64 = 0.01;

/// The meaning of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RoadLineKind {
    /// A step at the edge of the road.
    Kerb {
        /// Height of the ground beyond it above the road, m; the mean of the line.
        height_m: f64,
    },
    /// The edge of the road without a step.
    Edge,
    /// Paint along the road.
    Marking {
        /// Whether it has no gaps.
        is_solid: bool,
    },
}

/// A line along a street.
#[derive(Clone, Debug, PartialEq)]
pub struct RoadLine {
    /// Its meaning.
    pub kind: RoadLineKind,
    /// Vertices in the frame of the clouds at the height of the road, at most 5 m apart, m.
    pub places: Vec<[f64; 3]>,
}

/// The lines along all roads. Edges end where a street joins from the side or nothing is seen beyond the road.
pub fn road_lines(strips: &RoadStrips) -> Vec<RoadLine> {
    let mut lines = Vec::new();
    for (road, driven) in strips.roads().iter().enumerate() {
        let sections = cross_sections(strips, road);
        for side in 0..2 {
            lines.extend(edges(&sections, &driven.stations, side));
        }
        lines.extend(markings(&sections, &driven.stations));
    }
    lines
}

/// A place to the left of a station.
fn place(station: &Station, left_m: f64, height_m: f64) -> [f64; 3] {
    let [dx, dy] = station.direction;
    [station.place[0] - dy * left_m, station.place[1] + dx * left_m, height_m]
}

/// The edge of a road at a cross section.
struct EdgePlace {
    place: [f64; 3],
    kerb_m: f64,
}

fn edges(sections: &[CrossSection], stations: &[Station], side: usize) -> Vec<RoadLine> {
    let edge = |section: &CrossSection| {
        let SideSection { edge_m, is_seen, kerb_m, height_m, .. } = section.sides?[side];
        let height_m = height_m.or(section.height_m).filter(|_| is_seen)?;
        Some(EdgePlace { place: place(&stations[section.station], edge_m, height_m), kerb_m })
    };
    let found: Vec<Option<EdgePlace>> = sections.iter().map(edge).collect();
    let mut lines = Vec::new();
    for run in found.split(Option::is_none) {
        let run: Vec<&EdgePlace> = run.iter().flatten().collect();
        // Where a kerb ends, the line of the edge goes on from its last place.
        let mut start = 0;
        for end in 1..=run.len() {
            let is_kerb = |k: usize| run[k].kerb_m > 0.0;
            if end < run.len() && is_kerb(end) == is_kerb(start) {
                continue;
            }
            let part = &run[start..(end + 1).min(run.len())];
            let kind = if is_kerb(start) {
                let own = &run[start..end];
                RoadLineKind::Kerb { height_m: own.iter().map(|edge| edge.kerb_m).sum::<f64>() / own.len() as f64 }
            } else {
                RoadLineKind::Edge
            };
            if part.len() > 1 {
                lines.push(RoadLine { kind, places: part.iter().map(|edge| edge.place).collect() });
            }
            start = end;
            if start >= run.len() {
                break;
            }
        }
    }
    lines
}

fn markings(sections: &[CrossSection], stations: &[Station]) -> Vec<RoadLine> {
    let mut lines: Vec<RoadLine> = Vec::new();
    // The side of traffic decides about directions of lanes only.
    for section in lane_sections(sections, Traffic::Right).into_iter().flatten() {
        for boundary in &section.boundaries {
            let is_solid = match boundary.mark {
                Mark::Solid => true,
                Mark::Broken => false,
                Mark::None | Mark::Edge => continue,
            };
            let at = |(along_m, left_m): (&f64, &f64)| {
                let number = (along_m / STATION_M).round() as usize;
                let near = sections.partition_point(|section| section.station < number);
                let height_m = sections[near..].iter().chain(sections[..near].iter().rev()).find_map(|s| s.height_m);
                Some(place(&stations[number.min(stations.len() - 1)], *left_m, height_m?))
            };
            let places: Option<Vec<[f64; 3]>> = section.along_m.iter().zip(&boundary.left_m).map(at).collect();
            let Some(places) = places.filter(|places| places.len() > 1) else { continue };
            let kind = RoadLineKind::Marking { is_solid };
            let continues = |line: &&mut RoadLine| {
                let [a, b] = [line.places[line.places.len() - 1], places[0]];
                line.kind == kind && (a[0] - b[0]).hypot(a[1] - b[1]) < SAME_END_M
            };
            match lines.iter_mut().find(continues) {
                Some(line) => line.places.extend(&places[1..]),
                None => lines.push(RoadLine { kind, places }),
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::removal::tests::point;
    use crate::road::DrivenRoad;
    use messages::ClassId;

    /// A road of 7 m to the north with a kerb of 12 cm on the left, a flat verge on the right, and a solid line in the middle. A street joins
    /// from the left between 40 and 60 m.
    fn strips() -> RoadStrips {
        let station = |k: usize| Station { place: [0.0, STATION_M * k as f64], direction: [0.0, 1.0] };
        let mut strips = RoadStrips::new(vec![DrivenRoad { stations: (0..=200).map(station).collect() }]);
        for (x, y) in (-140..140).flat_map(|x| (0..1000).map(move |y| (f64::from(x) * 0.1 + 0.05, f64::from(y) * 0.1)))
        {
            let is_mouth = (40.0..60.0).contains(&y);
            let (class, z) = match x {
                x if x < -3.5 && !is_mouth => (ClassId::Sidewalk, 0.12),
                x if x > 3.5 => (ClassId::Terrain, 0.0),
                x if x.abs() < 0.1 => (ClassId::RoadLine, 0.0),
                _ => (ClassId::Road, 0.0),
            };
            strips.add(&point(class, [x, y, z + 0.01 * y]));
        }
        strips
    }

    #[test]
    fn kerb_edge_and_marking_are_where_they_were_built() {
        let lines = road_lines(&strips());
        let of_kind = |wanted: fn(&RoadLineKind) -> bool| lines.iter().filter(move |line| wanted(&line.kind));
        let kerbs: Vec<&RoadLine> = of_kind(|kind| matches!(kind, RoadLineKind::Kerb { .. })).collect();
        let edges: Vec<&RoadLine> = of_kind(|kind| matches!(kind, RoadLineKind::Edge)).collect();
        let marks: Vec<&RoadLine> = of_kind(|kind| matches!(kind, RoadLineKind::Marking { .. })).collect();
        assert_eq!((kerbs.len(), edges.len(), marks.len()), (2, 1, 1), "{lines:?}");
        for (line, x) in kerbs.iter().map(|line| (*line, -3.5)).chain([(edges[0], 3.5), (marks[0], 0.0)]) {
            for place in &line.places {
                assert!((place[0] - x).abs() < 0.11, "{:?} at {place:?}", line.kind);
                assert!((place[2] - 0.01 * place[1]).abs() < 0.03, "{:?} at {place:?}", line.kind);
            }
        }
        let RoadLineKind::Kerb { height_m } = kerbs[0].kind else { unreachable!("a kerb") };
        assert!((height_m - 0.12).abs() < 0.02, "{height_m}");
        assert!(kerbs[0].places.iter().chain(&kerbs[1].places).all(|p| p[1] < 44.0 || p[1] > 56.0), "{kerbs:?}");
        assert_eq!(marks[0].kind, RoadLineKind::Marking { is_solid: true });
        assert!(marks[0].places[marks[0].places.len() - 1][1] - marks[0].places[0][1] > 95.0);
    }
}
