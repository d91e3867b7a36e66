//! Surface of junctions: the road between the streets' own pavements, and the corners between neighboring streets.

use crate::construction::ground::{Skirt, skirt, vertex};
use crate::construction::town_builder::TownBuilder;
use crate::streets::network::Arm;
use crate::streets::paving::Paving;
use crate::streets::street::Street;
use nalgebra::Vector2;

/// Number of cells around a corner; even, so that the corner itself is on a cell boundary.
const AROUND: usize = 12;
/// Number of cells from the middle of the junction to its edge.
const OUTWARD: usize = 6;
/// Height of the middle of the junction above the terrain, m: equal to the middle of a lane.
const MIDDLE_H: f64 = -0.03;
/// Cell boundaries across the corner sidewalk, as shares of its width; the first cell is the kerb stone.
const ACROSS: [f64; 5] = [0.0, 0.06, 0.35, 0.68, 1.0];

/// A position and its height above the terrain.
type Spot = (Vector2<f64>, f64);

/// Builds the surface of a junction. Dead ends and nodes where a street continues have no surface.
pub fn pave(town: &mut TownBuilder, node: usize) {
    if !town.network.nodes[node].is_junction() {
        return;
    }
    let arms = town.network.nodes[node].arms.clone();
    let mut edge: Vec<Spot> = Vec::new();
    for (k, arm) in arms.iter().enumerate() {
        let next = arms[(k + 1) % arms.len()];
        edge.extend(mouth(town, arm));
        let corner = CornerLine::new(town, *arm, next);
        edge.extend((1..AROUND).map(|i| corner.kerb(i)));
        sidewalk(town, &corner);
    }
    let middle = town.network.nodes[node].at;
    let asphalt = town.pavings.id(Paving::Asphalt);
    for i in 0..edge.len() {
        let this = edge[i];
        let next = edge[(i + 1) % edge.len()];
        for ring in 0..OUTWARD {
            let at = |(p, h): Spot, ring: usize| {
                let share = ring as f64 / OUTWARD as f64;
                vertex(town, &middle.lerp(&p, share), MIDDLE_H + (h - MIDDLE_H) * share)
            };
            let corners = [at(this, ring), at(this, ring + 1), at(next, ring + 1), at(next, ring)];
            if ring == 0 {
                town.builder.add(raytrace::Shape::triangle(corners[0], corners[1], corners[2]), asphalt);
            } else {
                town.builder.quad(corners, asphalt);
            }
        }
    }
}

/// The edge of the road at the start of an arm, from its right to its left kerb: the vertices of the arm's own cells.
fn mouth(town: &TownBuilder, arm: &Arm) -> Vec<Spot> {
    let street = &town.network.streets[arm.street];
    let kerb = street.profile.kerb_t;
    let columns = street.profile.columns().into_iter().filter(|t| t.abs() <= kerb);
    columns
        .map(|t| {
            let (s, t) = street.at_node(arm.end, arm.mouth_m, t);
            (street.plan(s, t), street.profile.road_height(t))
        })
        .collect()
}

/// The lines around the corner between an arm and the next one counterclockwise.
struct CornerLine {
    /// The two neighboring streets.
    streets: [Street; 2],
    /// Kerb line: at the mouth of the first street, at the intersection, at the mouth of the second street.
    kerb: [Vector2<f64>; 3],
    /// Facade line, with the same three points.
    outer: [Vector2<f64>; 3],
}

impl CornerLine {
    fn new(town: &TownBuilder, arm: Arm, next: Arm) -> Self {
        let [a, b] = [arm, next].map(|arm| town.network.streets[arm.street].clone());
        let place = |arm: Arm, street: &Street, s: f64, t: f64| {
            let (s, t) = street.at_node(arm.end, s, t);
            street.plan(s, t)
        };
        let line = |ta: f64, tb: f64, met_a: f64, met_b: f64| {
            let met = (place(arm, &a, met_a, ta) + place(next, &b, met_b, -tb)) * 0.5;
            [place(arm, &a, arm.mouth_m, ta), met, place(next, &b, next.mouth_m, -tb)]
        };
        let kerb = line(a.profile.kerb_t, b.profile.kerb_t, arm.left.kerb_m, next.right.kerb_m);
        let outer = line(a.profile.outer_t, b.profile.outer_t, arm.left.outer_m, next.right.outer_m);
        Self { streets: [a, b], kerb, outer }
    }
    /// Point `i` of [`AROUND`] on the kerb, rounded by a quadratic Bezier curve.
    fn kerb_place(&self, i: usize) -> Vector2<f64> {
        let u = i as f64 / AROUND as f64;
        let [a, b, c] = self.kerb;
        a.lerp(&b, u).lerp(&b.lerp(&c, u), u)
    }
    /// Point `i` of [`AROUND`] on the facade line, with a sharp corner.
    fn outer_place(&self, i: usize) -> Vector2<f64> {
        let u = 2.0 * i as f64 / AROUND as f64;
        let [a, b, c] = self.outer;
        if u <= 1.0 { a.lerp(&b, u) } else { b.lerp(&c, u - 1.0) }
    }
    /// Height at `share` of the distance from kerb to outer edge, interpolated between both streets.
    fn height(&self, i: usize, share: f64) -> f64 {
        let [a, b] = [0, 1].map(|k| {
            let profile = self.streets[k].profile;
            profile.side_height(profile.kerb_t + (profile.outer_t - profile.kerb_t) * share)
        });
        a + (b - a) * i as f64 / AROUND as f64
    }
    /// The edge of the road.
    fn kerb(&self, i: usize) -> Spot {
        let [a, b] = [0, 1].map(|k| self.streets[k].profile.road_height(self.streets[k].profile.kerb_t));
        (self.kerb_place(i), a + (b - a) * i as f64 / AROUND as f64)
    }
}

fn sidewalk(town: &mut TownBuilder, corner: &CornerLine) {
    for i in 0..AROUND {
        let street = &corner.streets[usize::from(2 * i >= AROUND)];
        let profile = street.profile;
        let place = |i: usize, share: f64| corner.kerb_place(i).lerp(&corner.outer_place(i), share);
        let mut quads = Vec::new();
        for pair in ACROSS.windows(2) {
            let at = |i: usize, share: f64| vertex(town, &place(i, share), corner.height(i, share));
            let middle = profile.kerb_t + (profile.outer_t - profile.kerb_t) * 0.5 * (pair[0] + pair[1]);
            let paving = profile.side_paving(middle);
            quads.push(([at(i, pair[0]), at(i + 1, pair[0]), at(i + 1, pair[1]), at(i, pair[1])], paving));
        }
        if profile.has_kerb() {
            let at = |i: usize, h: f64| vertex(town, &place(i, 0.0), h);
            let low = |i: usize| at(i, corner.kerb(i).1 - 0.02);
            let high = |i: usize| at(i, corner.height(i, 0.0));
            quads.push(([low(i), low(i + 1), high(i + 1), high(i)], Paving::Kerb));
        }
        if let Some(Skirt { width_m, far_height_m, paving }) = skirt(street) {
            let out = |i: usize| {
                let away = (corner.outer_place(i) - corner.kerb_place(i)).normalize();
                vertex(town, &(corner.outer_place(i) + away * width_m), far_height_m)
            };
            let at = |i: usize| vertex(town, &place(i, 1.0), corner.height(i, 1.0));
            quads.push(([at(i), at(i + 1), out(i + 1), out(i)], paving));
        }
        for (corners, paving) in quads {
            let id = town.pavings.id(paving);
            town.builder.quad(corners, id);
        }
    }
}
