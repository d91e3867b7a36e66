//! Roads as ASAM OpenDRIVE 1.7.
//!
//! Coordinates are in the frame of the clouds: x east, y north, z up. The reference line is the smoothed path of the vehicle; a lane offset moves the
//! lanes to the boundary between the directions.

use super::cross_section::{CrossSection, along_m, cross_sections};
use super::lanes::{Lane, LaneKind, LaneSection, Mark, Traffic, lane_sections};
use super::path::Station;
use super::strip::RoadStrips;
use geometry::LocalFrame;
use serde::Serialize;
use std::fmt::Write;

/// Intervals of Simpson's rule for the length of a curve: an error below a micrometer for curves of 5 m.
const INTERVALS: usize = 16;
/// Width of painted lines, m (Vienna Convention: 0.10 to 0.15 m).
const PAINT_M: f64 = 0.12;

/// The document and what it contains.
#[derive(Clone, Debug, PartialEq)]
pub struct RoadNetwork {
    /// The XML.
    pub document: String,
    /// Its contents.
    pub summary: RoadSummary,
}

/// Contents of a road network.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RoadSummary {
    /// Number of roads.
    pub roads: usize,
    /// Their length, m.
    pub length_m: f64,
    /// Length of lanes for vehicles, m.
    pub driving_lanes_m: f64,
    /// Length of sidewalks, m.
    pub sidewalks_m: f64,
    /// Length of painted boundaries, m.
    pub painted_m: f64,
    /// Length of driven streets without road around the path, m.
    pub left_out_m: f64,
    /// Length of road edges beyond which nothing was seen, m.
    pub unseen_edges_m: f64,
}

/// A cubic curve from one station to the next.
struct Curve {
    start: [f64; 2],
    heading: f64,
    /// Coefficients of u and v in the frame of the start.
    u: [f64; 4],
    v: [f64; 4],
    length_m: f64,
}

impl Curve {
    /// The curve with the directions of both stations (cubic Hermite).
    fn between(a: &Station, b: &Station) -> Self {
        let [du, dv] = a.along_and_left(b.place);
        let chord_m = du.hypot(dv);
        let [cos, sin] = [
            a.direction[0] * b.direction[0] + a.direction[1] * b.direction[1],
            a.direction[0] * b.direction[1] - a.direction[1] * b.direction[0],
        ];
        let hermite =
            |end: f64, first: f64, last: f64| [0.0, first, 3.0 * end - 2.0 * first - last, first + last - 2.0 * end];
        let u = hermite(du, chord_m, chord_m * cos);
        let v = hermite(dv, 0.0, chord_m * sin);
        let speed = |p: f64| {
            let slope = |c: [f64; 4]| c[1] + 2.0 * c[2] * p + 3.0 * c[3] * p * p;
            slope(u).hypot(slope(v))
        };
        let h = 1.0 / INTERVALS as f64;
        let weight = |k: usize| match k {
            0 | INTERVALS => 1.0,
            k if k % 2 == 1 => 4.0,
            _ => 2.0,
        };
        let length_m = (0..=INTERVALS).map(|k| weight(k) * speed(k as f64 * h)).sum::<f64>() * h / 3.0;
        Self { start: a.place, heading: a.direction[1].atan2(a.direction[0]), u, v, length_m }
    }
}

/// The roads along the strips. `frame` is the frame of the clouds, if it is known where it is on the Earth.
pub fn opendrive(strips: &RoadStrips, traffic: Traffic, frame: Option<&LocalFrame>) -> RoadNetwork {
    let mut summary = RoadSummary::default();
    let mut roads = String::new();
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for road in 0..strips.roads().len() {
        let sections = cross_sections(strips, road);
        let stations = &strips.roads()[road].stations;
        count_uncertain(&sections, &mut summary);
        for run in lane_sections(&sections, traffic) {
            let Some(written) = Road::new(run, &sections, stations) else { continue };
            for station in &written.stations {
                low = std::array::from_fn(|axis| low[axis].min(station.place[axis]));
                high = std::array::from_fn(|axis| high[axis].max(station.place[axis]));
            }
            summary.roads += 1;
            written.write(summary.roads, traffic, &mut roads, &mut summary);
        }
    }
    if summary.roads == 0 {
        [low, high] = [[0.0; 2]; 2];
    }
    let reference = frame.map_or_else(String::new, |frame| {
        let origin = frame.origin();
        format!(
            "    <geoReference><![CDATA[+proj=tmerc +lat_0={:.9} +lon_0={:.9} +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +vunits=m +no_defs]]></geoReference>\n",
            origin.latitude_deg, origin.longitude_deg
        )
    });
    let document = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<OpenDRIVE>\n  <header revMajor=\"1\" revMinor=\"7\" name=\"scene\" vendor=\"REPLICA\" \
         north=\"{:.3}\" south=\"{:.3}\" east=\"{:.3}\" west=\"{:.3}\">\n{reference}  </header>\n{roads}</OpenDRIVE>\n",
        high[1], low[1], high[0], low[0]
    );
    RoadNetwork { document, summary }
}

/// Lengths that are left out or uncertain.
fn count_uncertain(sections: &[CrossSection], summary: &mut RoadSummary) {
    for pair in sections.windows(2) {
        let length_m = along_m(&pair[1]) - along_m(&pair[0]);
        match pair[0].sides.zip(pair[1].sides) {
            None => summary.left_out_m += length_m,
            Some((sides, _)) => {
                summary.unseen_edges_m += length_m * sides.iter().filter(|side| !side.is_seen).count() as f64;
            }
        }
    }
}

/// A road of the document.
struct Road {
    sections: Vec<LaneSection>,
    stations: Vec<Station>,
    curves: Vec<Curve>,
    /// Distance along the reference line and height of each station, m.
    s_m: Vec<f64>,
    heights_m: Vec<f64>,
    /// Distances of the stations along the path, m.
    along_m: Vec<f64>,
}

impl Road {
    /// `None` without heights.
    fn new(run: Vec<LaneSection>, sections: &[CrossSection], stations: &[Station]) -> Option<Self> {
        let first_m = *run.first()?.along_m.first()?;
        let last_m = *run.last()?.along_m.last()?;
        let own: Vec<&CrossSection> =
            sections.iter().filter(|section| (first_m..=last_m).contains(&along_m(section))).collect();
        let heights_m = filled(&own.iter().map(|section| section.height_m).collect::<Vec<_>>())?;
        let stations: Vec<Station> = own.iter().map(|section| stations[section.station]).collect();
        let curves: Vec<Curve> = stations.windows(2).map(|pair| Curve::between(&pair[0], &pair[1])).collect();
        let mut s_m = vec![0.0];
        for curve in &curves {
            s_m.push(s_m[s_m.len() - 1] + curve.length_m);
        }
        let along_m = own.iter().map(|section| along_m(section)).collect();
        Some(Self { sections: run, stations, curves, s_m, heights_m, along_m })
    }

    /// Distance along the reference line of a cross section, m.
    fn s(&self, along_m: f64) -> f64 {
        let idx = self.along_m.partition_point(|at| *at < along_m - 1e-6);
        self.s_m[idx.min(self.s_m.len() - 1)]
    }

    fn length_m(&self) -> f64 {
        self.s_m[self.s_m.len() - 1]
    }

    fn write(&self, id: usize, traffic: Traffic, text: &mut String, summary: &mut RoadSummary) {
        let length_m = self.length_m();
        summary.length_m += length_m;
        let rule = match traffic {
            Traffic::Right => "RHT",
            Traffic::Left => "LHT",
        };
        let mut line = |line: String| {
            text.push_str(&line);
            text.push('\n');
        };
        line(format!("  <road name=\"\" length=\"{length_m:.6}\" id=\"{id}\" junction=\"-1\" rule=\"{rule}\">"));
        line("    <type s=\"0\" type=\"town\"/>".into());
        line("    <planView>".into());
        for (curve, s_m) in self.curves.iter().zip(&self.s_m) {
            let Curve { start: [x, y], heading, length_m, u, v } = curve;
            line(format!(
                "      <geometry s=\"{s_m:.6}\" x=\"{x:.6}\" y=\"{y:.6}\" hdg=\"{heading:.9}\" length=\"{length_m:.6}\">"
            ));
            let [au, bu, cu, du] = u;
            let [av, bv, cv, dv] = v;
            line(format!(
                "        <paramPoly3 aU=\"{au:.9}\" bU=\"{bu:.9}\" cU=\"{cu:.9}\" dU=\"{du:.9}\" aV=\"{av:.9}\" bV=\"{bv:.9}\" \
                 cV=\"{cv:.9}\" dV=\"{dv:.9}\" pRange=\"normalized\"/>"
            ));
            line("      </geometry>".into());
        }
        line("    </planView>\n    <elevationProfile>".into());
        for polynomial in linear(&self.s_m, &self.heights_m) {
            line(format!("      <elevation s=\"{:.6}\" {}/>", polynomial.at_m, polynomial.attributes()));
        }
        line("    </elevationProfile>\n    <lanes>".into());
        for section in &self.sections {
            let (s_m, offsets) = self.values(section, |k| section.boundaries[section.center].left_m[k]);
            for polynomial in linear(&s_m, &offsets) {
                line(format!("      <laneOffset s=\"{:.6}\" {}/>", polynomial.at_m, polynomial.attributes()));
            }
        }
        for (number, section) in self.sections.iter().enumerate() {
            let before = number.checked_sub(1).map(|number| &self.sections[number]);
            let after = self.sections.get(number + 1);
            line(self.lane_section(section, [before, after], summary));
        }
        line("    </lanes>\n  </road>".into());
    }

    /// Places and values of a lane section.
    fn values(&self, section: &LaneSection, value: impl Fn(usize) -> f64) -> (Vec<f64>, Vec<f64>) {
        let n = section.along_m.len();
        (section.along_m.iter().map(|along_m| self.s(*along_m)).collect(), (0..n).map(value).collect())
    }

    fn lane_section(
        &self,
        section: &LaneSection,
        near: [Option<&LaneSection>; 2],
        summary: &mut RoadSummary,
    ) -> String {
        let start_m = self.s(section.along_m[0]);
        let end_m = self.s(section.along_m[section.along_m.len() - 1]);
        let length_m = end_m - start_m;
        let mut text = format!("      <laneSection s=\"{start_m:.6}\">");
        let painted = section.boundaries.iter().filter(|boundary| matches!(boundary.mark, Mark::Broken | Mark::Solid));
        summary.painted_m += length_m * painted.count() as f64;
        let mut side = |name: &str, is_left: bool| {
            let lanes: Vec<&Lane> = section.lanes.iter().rev().filter(|lane| (lane.id > 0) == is_left).collect();
            if lanes.is_empty() {
                return String::new();
            }
            let mut text = format!("\n        <{name}>");
            for lane in lanes {
                match lane.kind {
                    LaneKind::Driving => summary.driving_lanes_m += length_m,
                    LaneKind::Sidewalk { .. } => summary.sidewalks_m += length_m,
                }
                text += &self.lane(section, lane, near, start_m);
            }
            text + &format!("\n        </{name}>")
        };
        text += &side("left", true);
        let _ = write!(
            text,
            "\n        <center>\n          <lane id=\"0\" type=\"none\" level=\"false\">\n            {}\n          </lane>\n        </center>",
            road_mark(section.boundaries[section.center].mark)
        );
        text += &side("right", false);
        text + "\n      </laneSection>"
    }

    fn lane(
        &self,
        section: &LaneSection,
        lane: &Lane,
        [before, after]: [Option<&LaneSection>; 2],
        start_m: f64,
    ) -> String {
        let kind = match lane.kind {
            LaneKind::Driving => "driving",
            LaneKind::Sidewalk { .. } => "sidewalk",
        };
        let mut text = format!("\n          <lane id=\"{}\" type=\"{kind}\" level=\"false\">", lane.id);
        let neighbors = [
            ("predecessor", before.and_then(|other| same_lane([section, other], lane, true))),
            ("successor", after.and_then(|other| same_lane([section, other], lane, false))),
        ];
        if neighbors.iter().any(|(_, id)| id.is_some()) {
            text += "\n            <link>";
            for (name, id) in neighbors {
                if let Some(id) = id {
                    let _ = write!(text, "<{name} id=\"{id}\"/>");
                }
            }
            text += "</link>";
        }
        let width =
            |k: usize| (section.boundaries[lane.outer].left_m[k] - section.boundaries[lane.inner].left_m[k]).abs();
        let (s_m, widths) = self.values(section, width);
        for polynomial in linear(&s_m, &widths) {
            let offset_m = polynomial.at_m - start_m;
            let _ = write!(text, "\n            <width sOffset=\"{offset_m:.6}\" {}/>", polynomial.attributes());
        }
        let _ = write!(text, "\n            {}", road_mark(section.boundaries[lane.outer].mark));
        if let LaneKind::Sidewalk { kerb_mm } = lane.kind {
            let height_m = f64::from(kerb_mm) / 1000.0;
            let _ =
                write!(text, "\n            <height sOffset=\"0\" inner=\"{height_m:.3}\" outer=\"{height_m:.3}\"/>");
        }
        text + "\n          </lane>"
    }
}

/// Largest gap between the boundaries of a lane and its continuation, m: rounding.
const MEETING_M: f64 = 1e-6;

/// Number of the lane that continues a lane in a neighboring section: the one of its kind with the same boundaries where they meet.
fn same_lane([own, other]: [&LaneSection; 2], lane: &Lane, is_before: bool) -> Option<i32> {
    let edges = |section: &LaneSection, lane: &Lane, is_first: bool| {
        [lane.inner, lane.outer].map(|boundary| {
            let values = &section.boundaries[boundary].left_m;
            if is_first { values[0] } else { values[values.len() - 1] }
        })
    };
    let ends = edges(own, lane, is_before);
    let continues = |found: &&Lane| {
        let starts = edges(other, found, !is_before);
        matches!(lane.kind, LaneKind::Driving) == matches!(found.kind, LaneKind::Driving)
            && (lane.id > 0) == (found.id > 0)
            && ends.iter().zip(starts).all(|(end, start)| (end - start).abs() < MEETING_M)
    };
    other.lanes.iter().find(continues).map(|found| found.id)
}

fn road_mark(mark: Mark) -> String {
    let kind = match mark {
        Mark::None => "none",
        Mark::Broken => "broken",
        Mark::Solid => "solid",
        Mark::Edge => "curb",
    };
    let change = if mark == Mark::Broken { "both" } else { "none" };
    format!(
        "<roadMark sOffset=\"0\" type=\"{kind}\" weight=\"standard\" color=\"white\" width=\"{PAINT_M}\" laneChange=\"{change}\"/>"
    )
}

/// A value that changes linearly from a place on.
struct Polynomial {
    at_m: f64,
    value: f64,
    slope: f64,
}

impl Polynomial {
    fn attributes(&self) -> String {
        format!("a=\"{:.6}\" b=\"{:.9}\" c=\"0\" d=\"0\"", self.value, self.slope)
    }
}

/// Slopes that differ by less are one line.
const SAME_SLOPE: f64 = 1e-9;

/// Linear pieces through values at increasing places, as few as there are slopes.
fn linear(s_m: &[f64], values: &[f64]) -> Vec<Polynomial> {
    let piece = |k: usize| {
        let length_m = s_m[k + 1] - s_m[k];
        let slope = if length_m > 0.0 { (values[k + 1] - values[k]) / length_m } else { 0.0 };
        Polynomial { at_m: s_m[k], value: values[k], slope }
    };
    let mut pieces: Vec<Polynomial> = (0..s_m.len().saturating_sub(1)).map(piece).collect();
    pieces.dedup_by(|next, before| (next.slope - before.slope).abs() < SAME_SLOPE);
    pieces
}

/// Values with gaps closed by interpolation. `None` without values.
fn filled(values: &[Option<f64>]) -> Option<Vec<f64>> {
    let known: Vec<(usize, f64)> = values.iter().enumerate().filter_map(|(k, value)| Some((k, (*value)?))).collect();
    let first = known.first()?;
    let last = known.last()?;
    let at = |k: usize| {
        let after = known.partition_point(|(at, _)| *at < k);
        match (after.checked_sub(1).map(|before| known[before]), known.get(after)) {
            (Some((a, from)), Some((b, to))) => from + (to - from) * (k - a) as f64 / (b - a) as f64,
            (None, _) => first.1,
            (_, None) => last.1,
        }
    };
    Some((0..values.len()).map(at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::cross_section::tests::street;
    use geometry::Geodetic;

    #[test]
    fn curve_ends_at_the_next_station_with_its_direction() {
        let turn = |angle: f64| Station {
            place: [20.0 * angle.sin(), 20.0 * (1.0 - angle.cos())],
            direction: [angle.cos(), angle.sin()],
        };
        let curve = Curve::between(&turn(0.3), &turn(0.55));
        assert!((curve.length_m - 5.0).abs() < 1e-3, "{}", curve.length_m);
        let sum = |c: [f64; 4]| c.iter().sum::<f64>();
        let [along, left] = turn(0.3).along_and_left(turn(0.55).place);
        assert!((sum(curve.u) - along).abs() < 1e-9 && (sum(curve.v) - left).abs() < 1e-9);
    }

    #[test]
    fn street_becomes_a_road_with_lanes_and_sidewalks() {
        let strips = street(80);
        let frame = LocalFrame::new(Geodetic::new(48.8, 2.3, 60.0).expect("valid"));
        let RoadNetwork { document, summary } = opendrive(&strips, Traffic::Right, Some(&frame));
        assert_eq!(summary.roads, 1);
        assert!((summary.length_m - 79.5).abs() < 0.1, "{summary:?}");
        assert!(summary.sidewalks_m > 150.0 && summary.left_out_m <= 0.0, "{summary:?}");
        for part in [
            "+lat_0=48.800000000 +lon_0=2.300000000",
            "rule=\"RHT\"",
            "pRange=\"normalized\"",
            "type=\"solid\"",
            "type=\"curb\"",
            "type=\"sidewalk\"",
        ] {
            assert!(document.contains(part), "{part}: {document}");
        }
        let n = |text: &str| document.matches(text).count();
        assert_eq!((n("<road "), n("</road>"), n("<lane "), n("</lane>")), (1, 1, n("</lane>"), n("<lane ")));
        // Each slope of 1 % is a rise of 1 cm per meter.
        assert!(document.contains("b=\"0.010"), "{document}");
    }

    #[test]
    fn drive_without_roads_is_a_document_without_roads() {
        let RoadNetwork { document, summary } = opendrive(&RoadStrips::new(Vec::new()), Traffic::Left, None);
        assert_eq!(summary, RoadSummary::default());
        assert!(document.contains("north=\"0.000\"") && !document.contains("geoReference"));
    }

    #[test]
    fn gaps_are_interpolated() {
        assert_eq!(filled(&[None, Some(1.0), None, None, Some(4.0), None]), Some(vec![1.0, 1.0, 2.0, 3.0, 4.0, 4.0]));
        assert_eq!(filled(&[None, None]), None);
    }
}
