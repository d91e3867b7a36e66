//! The ground surface: streets with markings, kerbs and sidewalks, and meadows around and below them.

use crate::construction::reach::DETAIL_RADIUS_M;
use crate::construction::town_builder::TownBuilder;
use crate::streets::network::Network;
use crate::streets::paving::Paving;
use crate::streets::profile::StreetKind;
use crate::streets::street::Street;
use nalgebra::{Vector2, Vector3};
use raytrace::Vec3;

/// Distance of crosswalks behind the mouth of a street, and their length, m.
const CROSSWALK: [f64; 2] = [0.5, 3.0];
/// Start and end of stop lines before crosswalks, m from the mouth.
pub const STOP_LINE: [f64; 2] = [4.0, 4.5];
/// Start and end of stop lines of lanes without lights, m from the mouth.
pub const YIELD_LINE: [f64; 2] = [0.5, 1.0];
/// Length of the cells along streets, m: at markings and curves, and elsewhere.
const CELL_M: [f64; 2] = [0.5, 1.5];
/// Depth of the meadows below the terrain, m: lower than every road.
const BED_M: f64 = 0.16;
/// Cell size of the meadows, m. The terrain deviates from a plane by less than a centimeter within a cell.
const BED_CELL_M: f64 = 4.0;

/// A vertex of the ground mesh, `h` above the smooth terrain.
pub fn vertex(town: &TownBuilder, p: &Vector2<f64>, h: f64) -> Vec3 {
    let terrain = &town.network.terrain;
    Vector3::new(p.x, p.y, terrain.height(p) + terrain.uneven(p) + h).cast()
}

/// Builds the pavement of a street between its mouths.
pub fn street(town: &mut TownBuilder, number: usize) {
    let [begin, end] = town.network.mouths(number);
    let is_driven = town.is_on_round(number);
    let mut s = begin;
    while s < end - 1e-6 {
        let is_fine = is_driven || s - begin < 6.0 || end - s < 6.0;
        let cell = if is_fine { CELL_M[0] } else { CELL_M[1] };
        // The last cell covers the remainder.
        let next = if end - s < 1.6 * cell { end } else { s + cell };
        let middle = town.network.streets[number].plan(0.5 * (s + next), 0.0);
        if town.reach.is_near(&middle, DETAIL_RADIUS_M) {
            row(town, number, [s, next]);
        }
        s = next;
    }
}

fn row(town: &mut TownBuilder, number: usize, [s0, s1]: [f64; 2]) {
    let street = &town.network.streets[number];
    let profile = street.profile;
    let columns = profile.columns();
    let middle = 0.5 * (s0 + s1);
    let mut quads = Vec::with_capacity(columns.len() + 6);
    for pair in columns.windows(2) {
        let t = 0.5 * (pair[0] + pair[1]);
        let is_road = t.abs() < profile.kerb_t;
        let (paving, height): (Paving, &dyn Fn(f64) -> f64) = if is_road {
            (road_paving(&town.network, number, middle, t), &|t| profile.road_height(t))
        } else {
            (profile.side_paving(t), &|t| profile.side_height(t))
        };
        let corner = |s: f64, t: f64| vertex(town, &street.plan(s, t), height(t));
        quads.push(([corner(s0, pair[0]), corner(s1, pair[0]), corner(s1, pair[1]), corner(s0, pair[1])], paving));
    }
    for side in [-1.0, 1.0] {
        let at = |s: f64, t: f64, h: f64| vertex(town, &street.plan(s, side * t), h);
        if profile.has_kerb() {
            let t = profile.kerb_t;
            let low = profile.road_height(profile.kerb_t) - 0.02;
            let high = profile.side_height(profile.kerb_t);
            quads.push(([at(s0, t, low), at(s1, t, low), at(s1, t, high), at(s0, t, high)], Paving::Kerb));
        }
        if let Some(Skirt { width_m, far_height_m, paving }) = skirt(street) {
            let near = |s: f64| at(s, profile.outer_t, profile.side_height(profile.outer_t));
            let far = |s: f64| at(s, profile.outer_t + width_m, far_height_m);
            quads.push(([near(s0), near(s1), far(s1), far(s0)], paving));
        }
    }
    for (corners, paving) in quads {
        let id = town.pavings.id(paving);
        town.builder.quad(corners, id);
    }
}

/// The strip from the outer edge of a street to the meadows or facades.
pub struct Skirt {
    /// Width, m.
    pub width_m: f64,
    /// Height of its far edge above the terrain, m.
    pub far_height_m: f64,
    /// Its cover.
    pub paving: Paving,
}

/// The strip next to a street; `None` if the meadows start at its edge.
pub fn skirt(street: &Street) -> Option<Skirt> {
    let profile = street.profile;
    match profile.kind {
        StreetKind::Urban => {
            Some(Skirt { width_m: 0.8, far_height_m: profile.side_height(profile.outer_t), paving: Paving::Slab })
        }
        StreetKind::Residential | StreetKind::Village => {
            Some(Skirt { width_m: 1.4, far_height_m: -0.3, paving: Paving::Grass })
        }
        // The ditches of these streets end below the meadows.
        StreetKind::Country | StreetKind::Motorway { .. } => None,
    }
}

/// Cover of the road, including crosswalks and stop lines.
fn road_paving(network: &Network, number: usize, s: f64, t: f64) -> Paving {
    let street = &network.streets[number];
    let [begin, end] = network.mouths(number);
    for (node_end, from_mouth) in [(0, s - begin), (1, end - s)] {
        let node = &network.nodes[street.nodes[node_end]];
        if node.arms.len() < 3 {
            continue;
        }
        let inside = |span: [f64; 2]| (span[0]..span[1]).contains(&from_mouth);
        // Relative to the direction away from the node, traffic towards the node is on the left.
        let t_from_node = if node_end == 0 { t } else { -t };
        let is_incoming = (0.0..street.profile.kerb_t.min(3.1)).contains(&t_from_node);
        if node.has_lights {
            if inside(CROSSWALK) {
                let is_bar = ((t + 50.0) / 0.5).floor().rem_euclid(2.0) < 0.5;
                return if is_bar && t.abs() < street.profile.kerb_t - 0.3 { Paving::Paint } else { Paving::Asphalt };
            }
            if from_mouth < STOP_LINE[1] + 0.2 {
                return if inside(STOP_LINE) && is_incoming { Paving::Paint } else { Paving::Asphalt };
            }
        } else if from_mouth < YIELD_LINE[1] {
            let gives_way = !network.round.iter().any(|leg| leg.street == number);
            return if gives_way && is_incoming && inside(YIELD_LINE) { Paving::Paint } else { Paving::Asphalt };
        }
    }
    street.profile.road_paving(s, t)
}

/// Builds meadows around and below everything, so that the ground has no holes. Far cells are coarser and deeper.
pub fn bed(town: &mut TownBuilder) {
    let grass = town.pavings.id(Paving::Grass);
    let canals = town.canals();
    for (cell, depth, reach, is_far) in [(BED_CELL_M, BED_M, DETAIL_RADIUS_M + 20.0, false), (20.0, 0.7, 420.0, true)] {
        let [low, high] = town.reach.bounds(reach);
        let n = (high - low) / cell;
        for j in 0..n.y.ceil() as usize {
            for i in 0..n.x.ceil() as usize {
                let at = |di: usize, dj: usize| low + Vector2::new((i + di) as f64, (j + dj) as f64) * cell;
                let middle = (at(0, 0) + at(1, 1)) * 0.5;
                let distance = town.reach.distance(&middle);
                // Far cells overlap the near ones, so that the seam is closed.
                if distance > reach
                    || (is_far && distance < DETAIL_RADIUS_M - 20.0)
                    || canals.iter().any(|canal| canal.covers(&middle))
                {
                    continue;
                }
                let corner = |di: usize, dj: usize| -> Vec3 {
                    let p = at(di, dj);
                    Vector3::new(p.x, p.y, town.network.terrain.height(&p) - depth).cast()
                };
                let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                town.builder.quad(corners, grass);
            }
        }
    }
}
