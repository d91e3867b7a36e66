//! Streets and the nodes where they meet.
//!
//! Around a node the streets are cut at their mouths; the area between the mouths belongs to the junction. Two
//! neighboring streets share a corner: their facing kerb lines meet there, and so do their facade lines.

use crate::streets::street::Street;
use crate::terrain::Terrain;
use nalgebra::Vector2;

/// Distance between a corner of facades and the mouth, m: space for the kerb around the corner.
const ROUNDING_M: f64 = 4.0;
/// Search radius for corners around the node, m; streets meet at more than 45 degrees.
const CORNER_REACH_M: f64 = 45.0;

/// The street map of a town.
#[derive(Clone, Debug)]
pub struct Network {
    /// Terrain of the town.
    pub terrain: Terrain,
    /// Streets, by number.
    pub streets: Vec<Street>,
    /// Nodes, by number.
    pub nodes: Vec<Node>,
    /// Closed round of the ego vehicle.
    pub round: Vec<Leg>,
    /// Blocks, each bounded by four streets, counterclockwise.
    pub blocks: Vec<[Leg; 4]>,
}

/// A street in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leg {
    /// Number of the street.
    pub street: usize,
    /// Whether the direction is from its first node to its second.
    pub is_forward: bool,
}

/// A node where streets meet or end.
#[derive(Clone, Debug)]
pub struct Node {
    /// Its position.
    pub at: Vector2<f64>,
    /// Its streets, counterclockwise.
    pub arms: Vec<Arm>,
    /// Whether it has crosswalks and traffic lights.
    pub has_lights: bool,
}

/// The end of a street at a node.
#[derive(Clone, Copy, Debug)]
pub struct Arm {
    /// Number of the street.
    pub street: usize,
    /// 0: the street starts here. 1: it ends here.
    pub end: usize,
    /// Start of its own pavement, m from the node; 0 at dead ends and where the street continues.
    pub mouth_m: f64,
    /// Corner towards the next arm counterclockwise.
    pub left: Corner,
    /// Corner towards the next arm clockwise.
    pub right: Corner,
}

/// Intersections of the lines of a street with the lines of its neighbor, m from the node along this street.
#[derive(Clone, Copy, Debug, Default)]
pub struct Corner {
    /// The kerbs.
    pub kerb_m: f64,
    /// The facades.
    pub outer_m: f64,
}

impl Network {
    /// Joins streets at their nodes; `lit` returns whether a node has crosswalks and lights.
    pub fn new(terrain: Terrain, places: &[Vector2<f64>], streets: Vec<Street>, lit: impl Fn(usize) -> bool) -> Self {
        let nodes = places
            .iter()
            .enumerate()
            .map(|(number, at)| Node { at: *at, arms: arms(&streets, number), has_lights: lit(number) })
            .collect();
        Self { terrain, streets, nodes, round: Vec::new(), blocks: Vec::new() }
    }
    /// The arm of a street at one of its ends.
    pub fn arm(&self, street: usize, end: usize) -> &Arm {
        let node = &self.nodes[self.streets[street].nodes[end]];
        node.arms.iter().find(|arm| arm.street == street && arm.end == end).unwrap_or(&node.arms[0])
    }
    /// Start and end of a street's own pavement, as `s`.
    pub fn mouths(&self, street: usize) -> [f64; 2] {
        [self.arm(street, 0).mouth_m, self.streets[street].length_m - self.arm(street, 1).mouth_m]
    }
    /// Start and end of the facades along a side (1 left, -1 right), as `s`.
    pub fn facade_ends(&self, street: usize, side: f64) -> [f64; 2] {
        let begin = self.arm(street, 0);
        let end = self.arm(street, 1);
        let (first, last) = if side > 0.0 { (begin.left, end.right) } else { (begin.right, end.left) };
        [first.outer_m, self.streets[street].length_m - last.outer_m]
    }
    /// Intersections, as `s`, of a line along a street (at distance `t` on a side) with the same lines of its neighbors:
    /// the back corners of a row of houses.
    pub fn line_ends(&self, street: usize, side: f64, t: f64) -> [f64; 2] {
        let along = |end: usize| {
            let node = &self.nodes[self.streets[street].nodes[end]];
            let n = node.arms.len();
            let Some(k) = node.arms.iter().position(|arm| arm.street == street && arm.end == end) else { return 0.0 };
            if n < 2 {
                return 0.0;
            }
            let is_left = (side > 0.0) == (end == 0);
            let next = node.arms[if is_left { (k + 1) % n } else { (k + n - 1) % n }];
            let t_next = t - self.streets[street].profile.outer_t + self.streets[next.street].profile.outer_t;
            meeting(&self.streets[street], end, if is_left { t } else { -t }, &self.streets[next.street], t_next)
        };
        [along(0), self.streets[street].length_m - along(1)]
    }
    /// Lanes of the round, the rightmost first: see [`Profile::lanes_t`](crate::streets::profile::Profile::lanes_t).
    pub fn lanes_t(&self) -> Vec<f64> {
        self.streets[self.round[0].street].profile.lanes_t()
    }
    /// Distance from the rightmost lane of the round to the next lane on its left, which may have the opposite direction,
    /// m.
    pub fn left_lane_m(&self) -> f64 {
        let lanes = self.lanes_t();
        lanes.get(1).map_or(2.0 * lanes[0], |left| lanes[0] - left)
    }
    /// The node that a leg leads to.
    pub fn node_after(&self, leg: Leg) -> usize {
        self.streets[leg.street].nodes[usize::from(leg.is_forward)]
    }
}

impl Node {
    /// Whether there is pavement that belongs to no street: false at dead ends and where a street continues.
    pub fn is_junction(&self) -> bool {
        self.arms.iter().any(|arm| arm.mouth_m > 0.0)
    }
}

impl Leg {
    /// The street of this leg in the opposite direction.
    #[must_use]
    pub const fn reversed(self) -> Self {
        Self { street: self.street, is_forward: !self.is_forward }
    }
    /// Street coordinates of the position `s` m from the start of the leg, `t` to the left of its direction.
    pub const fn on(self, street: &Street, s: f64, t: f64) -> (f64, f64) {
        street.at_node(if self.is_forward { 0 } else { 1 }, s, t)
    }
}

fn arms(streets: &[Street], node: usize) -> Vec<Arm> {
    let mut arms: Vec<(f64, Arm)> = Vec::new();
    for (number, street) in streets.iter().enumerate() {
        for end in [0, 1] {
            if street.nodes[end] == node {
                // The direction away from the node.
                let angle =
                    if end == 0 { street.heading(0.0) } else { street.heading(street.length_m) + std::f64::consts::PI };
                let none = Corner::default();
                let arm = Arm { street: number, end, mouth_m: 0.0, left: none, right: none };
                arms.push((angle.rem_euclid(std::f64::consts::TAU), arm));
            }
        }
    }
    arms.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut arms: Vec<Arm> = arms.into_iter().map(|(_, arm)| arm).collect();
    let n = arms.len();
    if n < 2 || goes_on(streets, &arms) {
        return arms;
    }
    for k in 0..n {
        let this = arms[k];
        let next = arms[(k + 1) % n];
        let a = &streets[this.street];
        let b = &streets[next.street];
        let p = &a.profile;
        let q = &b.profile;
        arms[k].left = Corner {
            kerb_m: meeting(a, this.end, p.kerb_t, b, q.kerb_t),
            outer_m: meeting(a, this.end, p.outer_t, b, q.outer_t),
        };
        arms[(k + 1) % n].right = Corner {
            kerb_m: meeting(b, next.end, -q.kerb_t, a, p.kerb_t),
            outer_m: meeting(b, next.end, -q.outer_t, a, p.outer_t),
        };
    }
    for arm in &mut arms {
        arm.mouth_m = arm.left.outer_m.max(arm.right.outer_m) + ROUNDING_M;
    }
    arms
}

/// Whether a street only continues in another one, without a junction.
fn goes_on(streets: &[Street], arms: &[Arm]) -> bool {
    /// Largest bend, rad; streets meet at a mitre.
    const MOST_BEND: f64 = 0.02;
    let [a, b] = arms else { return false };
    let heading = |arm: &Arm| {
        let street = &streets[arm.street];
        if arm.end == 0 { street.heading(0.0) } else { street.heading(street.length_m) + std::f64::consts::PI }
    };
    let bend = (heading(a) - heading(b)).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
    bend.abs() < MOST_BEND && streets[a.street].profile == streets[b.street].profile
}

/// Distance from the node at which the line at `t` along `street` comes within `reach` of the center line of `other`.
fn meeting(street: &Street, end: usize, t: f64, other: &Street, reach: f64) -> f64 {
    let is_near = |s: f64| {
        let (s, t) = street.at_node(end, s, t);
        other.distance(&street.plan(s, t)) < reach
    };
    let far = CORNER_REACH_M.min(0.45 * street.length_m);
    let mut high = far;
    while high > 0.0 && !is_near(high) {
        high -= 0.5;
    }
    if high <= 0.0 {
        return 0.0;
    }
    let mut low = high;
    let mut high = (high + 0.5).min(far + 0.5);
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if is_near(middle) { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::streets::profile::Profile;

    /// A crossing of two straight streets at an angle, as four streets around node 0.
    fn crossing(angle: f64, profile: Profile) -> Network {
        let terrain = Terrain::new(4);
        let mut places = vec![Vector2::new(3.0, -2.0)];
        let mut streets = Vec::new();
        for (k, turn) in [0.0, angle, std::f64::consts::PI, std::f64::consts::PI + angle].into_iter().enumerate() {
            let direction = Vector2::new(turn.cos(), turn.sin());
            places.push(places[0] + direction * 90.0);
            // Every other street ends at the crossing.
            let (ends, nodes, direction) = if k % 2 == 0 {
                ([places[0], places[k + 1]], [0, k + 1], direction)
            } else {
                ([places[k + 1], places[0]], [k + 1, 0], -direction)
            };
            streets.push(Street::new(profile, nodes, ends, [direction; 2], terrain));
        }
        Network::new(terrain, &places, streets, |node| node == 0)
    }

    #[test]
    fn junction_corner_lies_where_street_lines_cross() {
        let profile = Profile::urban(3.2);
        for angle in [1.1_f64, 1.57, 2.0] {
            let network = crossing(angle, profile);
            let arms = &network.nodes[0].arms;
            assert_eq!(arms.iter().map(|arm| arm.street).collect::<Vec<_>>(), [0, 1, 2, 3]);
            // Two lines at distance w from the legs of an angle meet w / tan(angle / 2) from its tip.
            let expected = |w: f64, angle: f64| w / (0.5 * angle).tan();
            assert!((arms[0].left.outer_m - expected(profile.outer_t, angle)).abs() < 1e-3);
            assert!((arms[0].left.kerb_m - expected(profile.kerb_t, angle)).abs() < 1e-3);
            assert!((arms[1].left.outer_m - expected(profile.outer_t, std::f64::consts::PI - angle)).abs() < 1e-3);
            // Neighbors agree on the position.
            for k in 0..4 {
                let this = arms[k];
                let next = arms[(k + 1) % 4];
                let place = |arm: Arm, s: f64, t: f64| {
                    let street = &network.streets[arm.street];
                    let (s, t) = street.at_node(arm.end, s, t);
                    street.plan(s, t)
                };
                let a = place(this, this.left.outer_m, profile.outer_t);
                let b = place(next, next.right.outer_m, -profile.outer_t);
                assert!((a - b).norm() < 1e-2, "{a} {b}");
            }
        }
    }

    #[test]
    fn dead_end_has_no_junction() {
        let network = crossing(1.5, Profile::village());
        assert_eq!(network.arm(0, 1).mouth_m, 0.0);
        assert!(network.arm(0, 0).mouth_m > ROUNDING_M);
        assert_eq!(network.mouths(1)[0], 0.0);
    }
}
