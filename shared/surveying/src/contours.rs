//! Contour lines of the terrain, by marching squares on its coarse nodes.

use crate::error::DeliverError;
use crate::features::{Line, line_feature, write_features};
use crate::rasters::{Node, Nodes, WrittenRasters};
use crate::target_frame::TargetFrame;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// Name of the file.
pub const CONTOURS: &str = "contours.geojson";
/// Shorter lines are left out, m: stones, and what remains of objects.
const MIN_LENGTH_M: f64 = 5.0;
/// Every fifth line is an index contour, as on maps.
const INDEX_EVERY: i64 = 5;

/// An edge between a node and its neighbor to the east or to the north.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    node: Node,
    is_north: bool,
}

impl Edge {
    fn end(self) -> Node {
        let [x, y] = self.node;
        if self.is_north { [x, y + 1] } else { [x + 1, y] }
    }
}

/// A line through edges; closed if its last edge is its first one.
type Crossed = Vec<Edge>;

/// Writes contour lines with this difference in height into the existing folder `out`. Returns their number. Nothing is written unless the
/// rasters kept their nodes.
pub fn write_contours(
    rasters: &WrittenRasters,
    interval_mm: u32,
    frame: &TargetFrame<'_>,
    out: &Path,
) -> Result<usize, DeliverError> {
    let Some(nodes) = &rasters.nodes else { return Ok(0) };
    let features: Vec<Value> = contours(nodes, interval_mm).iter().map(line_feature).collect();
    write_features(&out.join(CONTOURS), frame, &features)?;
    Ok(features.len())
}

/// Contour lines in coordinates of the delivery, from low to high.
fn contours(nodes: &Nodes, interval_mm: u32) -> Vec<Line> {
    let nodes = nodes.smoothed();
    let interval_m = f64::from(interval_mm) / 1000.0;
    let mut lines = Vec::new();
    for (level, segments) in segments(&nodes, interval_m) {
        let height_m = level as f64 * interval_m;
        for edges in joined(&segments) {
            let places: Vec<[f64; 3]> = edges.iter().map(|edge| crossing(&nodes, *edge, height_m)).collect();
            let length_m: f64 = places.windows(2).map(|p| (p[1][0] - p[0][0]).hypot(p[1][1] - p[0][1])).sum();
            if length_m < MIN_LENGTH_M {
                continue;
            }
            let mut properties = Map::new();
            properties.insert("height_m".into(), json!((height_m * 1000.0).round() / 1000.0));
            properties.insert("is_index".into(), json!(level % INDEX_EVERY == 0));
            lines.push(Line { places, properties });
        }
    }
    lines
}

/// Where a contour crosses an edge.
fn crossing(nodes: &Nodes, edge: Edge, height_m: f64) -> [f64; 3] {
    let [from, to] = [edge.node, edge.end()];
    let [a, b] = [from, to].map(|node| f64::from(nodes.height(node)));
    let share = (height_m - a) / (b - a);
    let [p, q] = [from, to].map(|node| nodes.place(node));
    [p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1]), height_m]
}

/// Segments between the edges of squares of four known nodes, by number of the level.
fn segments(nodes: &Nodes, interval_m: f64) -> BTreeMap<i64, Vec<[Edge; 2]>> {
    let mut found: BTreeMap<i64, Vec<[Edge; 2]>> = BTreeMap::new();
    for node in nodes.all() {
        let [x, y] = node;
        // Counter-clockwise from the south-west corner, and the edges after each corner.
        let corners = [node, [x + 1, y], [x + 1, y + 1], [x, y + 1]].map(|node| f64::from(nodes.height(node)));
        if corners.iter().any(|height| height.is_nan()) {
            continue;
        }
        let edges = [
            Edge { node, is_north: false },
            Edge { node: [x + 1, y], is_north: true },
            Edge { node: [x, y + 1], is_north: false },
            Edge { node, is_north: true },
        ];
        let low = corners.iter().fold(f64::INFINITY, |low, height| low.min(*height));
        let high = corners.iter().fold(f64::NEG_INFINITY, |high, height| high.max(*height));
        for level in (low / interval_m).floor() as i64..=(high / interval_m).ceil() as i64 {
            let height_m = level as f64 * interval_m;
            let is_above = corners.map(|height| height >= height_m);
            let crossed: Vec<usize> = (0..4).filter(|k| is_above[*k] != is_above[(k + 1) % 4]).collect();
            let pairs: &[[usize; 2]] = match crossed[..] {
                [a, b] => &[[a, b]],
                // A saddle: the middle decides which corners are connected.
                [_, _, _, _] => {
                    let is_middle_above = corners.iter().sum::<f64>() / 4.0 >= height_m;
                    if is_middle_above == is_above[0] { &[[0, 1], [2, 3]] } else { &[[3, 0], [1, 2]] }
                }
                _ => continue,
            };
            let of_level = found.entry(level).or_default();
            of_level.extend(pairs.iter().map(|pair| pair.map(|k| edges[k])));
        }
    }
    found
}

/// Segments joined to lines: open ones from their first ends, then closed ones.
fn joined(segments: &[[Edge; 2]]) -> Vec<Crossed> {
    let mut at: BTreeMap<Edge, Vec<usize>> = BTreeMap::new();
    for (number, ends) in segments.iter().enumerate() {
        for end in ends {
            at.entry(*end).or_default().push(number);
        }
    }
    let mut is_used = vec![false; segments.len()];
    let mut follow = |start: Edge| {
        let mut line = vec![start];
        let mut end = start;
        while let Some(next) = at[&end].iter().copied().find(|number| !is_used[*number]) {
            is_used[next] = true;
            let [a, b] = segments[next];
            end = if a == end { b } else { a };
            line.push(end);
        }
        line
    };
    let ends = at.iter().filter(|(_, numbers)| numbers.len() == 1).map(|(edge, _)| *edge);
    let starts: Vec<Edge> = ends.chain(at.keys().copied()).collect();
    starts.into_iter().map(&mut follow).filter(|line| line.len() > 1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contours_of_a_hill_are_circles_at_their_heights() {
        // A cone of 40 m radius that rises by 10 m, in the middle of a plain at -1 m.
        let nodes = Nodes::from_heights(|[x, y]| {
            let off = (x - 128.0).hypot(y - 128.0);
            if off < 40.0 { (10.0 - 0.25 * off) as f32 } else { -1.0 }
        });
        let lines = contours(&nodes, 2000);
        let heights: Vec<f64> = lines.iter().map(|line| line.places[0][2]).collect();
        assert_eq!(heights, [0.0, 2.0, 4.0, 6.0, 8.0]);
        for line in &lines[1..] {
            assert_eq!(line.places.first(), line.places.last(), "closed");
            let radius_m = (10.0 - line.places[0][2]) / 0.25;
            let worst = line.places.iter().map(|[x, y, _]| ((x - 128.0).hypot(y - 128.0) - radius_m).abs());
            assert!(worst.fold(0.0, f64::max) < 0.3, "{radius_m}");
        }
        assert_eq!(lines[0].properties["is_index"], json!(true));
        assert_eq!(lines[1].properties["is_index"], json!(false));
    }

    #[test]
    fn contours_end_at_unknown_ground_and_saddles_do_not_cross() {
        let slope = Nodes::from_heights(|[x, y]| if y < 100.0 { 0.1 * x as f32 } else { f32::NEG_INFINITY });
        let lines = contours(&slope, 5000);
        // 5, 10, 15, 20 and 25 m, from the south edge to the end of the ground.
        assert_eq!(lines.len(), 5);
        for line in &lines {
            let north = line.places.iter().map(|place| place[1]).fold(0.0, f64::max);
            assert!((north - 99.5).abs() < 1e-6, "{north}");
        }
        let saddle = Nodes::from_heights(|[x, y]| (0.002 * (x - 127.3) * (y - 128.4)) as f32);
        let lines = contours(&saddle, 4000);
        assert!(lines.len() > 20, "{}", lines.len());
        // The branches of a hyperbola are in opposite quarters.
        for line in lines.iter().filter(|line| line.places[0][2] != 0.0) {
            let is_east = |place: &[f64; 3]| place[0] > 127.3;
            let first = is_east(&line.places[0]);
            assert!(line.places.iter().all(|place| is_east(place) == first), "{line:?}");
        }
    }
}
