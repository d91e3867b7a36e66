//! Lanes: the paths of vehicles and people through the street network.

use crate::path::GroundPath;
use crate::streets::network::{Leg, Network};
use crate::streets::street::resample;
use nalgebra::{Vector2, Vector3};

/// Spacing of the points of a lane's curve, m. Turns are smoothed over six points.
const SPACING_M: f64 = 3.0;
/// Handle share for vehicles: a cubic Bezier curve with this share of the chord is close to an arc of a quarter circle.
const HANDLE: f64 = 0.39;
/// Handle share for sharp turns: people must not walk through the corner house.
const SHARP_HANDLE: f64 = 0.62;

/// A path along streets.
#[derive(Clone, Debug)]
pub struct Lane {
    /// The closed path.
    pub path: GroundPath,
    /// For each leg, the positions where the path enters and leaves the street's own pavement, m along the path.
    pub legs: Vec<[f64; 2]>,
}

/// The closed path along legs, `t` m to the left of their direction. `None` without legs.
pub fn around(network: &Network, legs: &[Leg], t: f64) -> Option<Lane> {
    let mut line: Vec<Vector2<f64>> = Vec::new();
    let mut begins = Vec::new();
    for (k, leg) in legs.iter().enumerate() {
        let street = &network.streets[leg.street];
        let (from, to) = between_mouths(network, *leg);
        let n = ((to - from) / 1.0).ceil().max(1.0) as usize;
        let first = line.len();
        line.extend((0..=n).map(|i| {
            let (s, t) = leg.on(street, from + (to - from) * i as f64 / n as f64, t);
            street.plan(s, t)
        }));
        begins.push([first, line.len() - 1]);
        let next = legs[(k + 1) % legs.len()];
        if network.nodes[network.node_after(*leg)].is_junction() {
            line.extend(turn(network, *leg, next, t));
        } else {
            // The next leg starts where this one ends.
            line.pop();
        }
    }
    line.push(*line.first()?);
    let mut lengths = vec![0.0];
    for pair in line.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + (pair[1] - pair[0]).norm());
    }
    let total = lengths[lengths.len() - 1];
    let n = (total / SPACING_M).round().max(8.0) as usize;
    let mut even = resample(&line, n);
    even.pop();
    // Every lane has the crown of the streets.
    let height = network.streets[legs[0].street].profile.height(t);
    let points = even.iter().map(|p| Vector3::new(p.x, p.y, network.terrain.height(p) + height)).collect();
    let path = GroundPath::closed(points, total / n as f64, network.terrain)?;
    Some(Lane { path, legs: begins.iter().map(|ends| ends.map(|i| lengths[i])).collect() })
}

/// Start and end of a leg's own pavement, m from the start of the leg.
pub fn between_mouths(network: &Network, leg: Leg) -> (f64, f64) {
    let [begin, end] = network.mouths(leg.street);
    let length = network.streets[leg.street].length_m;
    if leg.is_forward { (begin, end) } else { (length - end, length - begin) }
}

/// Points through the junction between two legs, without the ends.
fn turn(network: &Network, leg: Leg, next: Leg, t: f64) -> Vec<Vector2<f64>> {
    let street = &network.streets[leg.street];
    let next_street = &network.streets[next.street];
    let (_, last) = between_mouths(network, leg);
    let (first, _) = between_mouths(network, next);
    let place = |leg: Leg, street: &crate::streets::street::Street, at: f64| {
        let on = |s: f64| {
            let (s, t) = leg.on(street, s, t);
            street.plan(s, t)
        };
        (on(at), (on(at + 0.05) - on(at - 0.05)).normalize())
    };
    let (a, a_direction) = place(leg, street, last);
    let (b, b_direction) = place(next, next_street, first);
    let is_beside_road = t.abs() > street.profile.kerb_t;
    let handle = if is_beside_road { SHARP_HANDLE } else { HANDLE } * (b - a).norm();
    let controls = [a, a + a_direction * handle, b - b_direction * handle, b];
    let n = ((b - a).norm() / 0.5).ceil() as usize;
    (1..n).map(|i| crate::streets::street::bezier(&controls, i as f64 / n as f64)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::streets::grid::{GridStyle, build};
    use crate::streets::profile::LANE_T;

    #[test]
    fn lane_keeps_distance_to_center_line() {
        for seed in [1, 2, 3] {
            let network = build(seed, &GridStyle::URBAN);
            let lane = around(&network, &network.round, -LANE_T).expect("legs");
            for (leg, [from, to]) in network.round.iter().zip(&lane.legs) {
                let street = &network.streets[leg.street];
                for i in 1..20 {
                    let at = from + (to - from) * f64::from(i) / 20.0;
                    let off = street.distance(&lane.path.point(at).xy());
                    assert!((off - LANE_T).abs() < 0.12, "{off} m off the center line");
                }
            }
        }
    }

    #[test]
    fn lane_turn_radius_is_drivable() {
        for seed in 0..8 {
            for style in [GridStyle::URBAN, GridStyle::SUBURBAN] {
                let network = build(seed, &style);
                let lane = around(&network, &network.round, -LANE_T).expect("legs");
                let n = lane.path.length_m() as usize;
                let sharpest = (0..n).map(|i| lane.path.curvature(i as f64).abs()).fold(0.0, f64::max);
                assert!((0.05..0.2).contains(&sharpest), "radius {} m, seed {seed}", 1.0 / sharpest);
            }
        }
    }
}
