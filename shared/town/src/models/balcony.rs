//! Balconies: slabs on a facade with a railing.

use super::opening::Opening;
use super::style::{Balconies, Rail, Style};
use super::wall::{FacadeSurfaces, WallFrame, block, course, cuts_of};
use crate::scene_builder::SceneBuilder;
use raytrace::Shape;

/// Height of railings, m.
const RAIL_M: f32 = 1.0;
/// Spacing of bars, m.
const GAP_M: f32 = 0.15;

/// The balcony of one window, if the style has one there; `place` counts windows along and up.
pub fn at_window(
    b: &mut SceneBuilder,
    plan: WallFrame<'_>,
    style: &Style,
    looks: &FacadeSurfaces,
    hole: &Opening,
    place: usize,
) {
    let (aside, reach) = match style.balconies {
        Balconies::Alternate if place.is_multiple_of(2) => (0.35, 0.75),
        Balconies::Loggias => (0.45, 1.25),
        _ => return,
    };
    let floor = hole.z[0] - style.window[2] + 0.05;
    balcony(b, plan, style, looks, [hole.u[0] - aside, hole.u[1] + aside], floor, reach);
}

/// A balcony along the whole front, on consoles.
pub fn along(
    b: &mut SceneBuilder,
    plan: WallFrame<'_>,
    style: &Style,
    looks: &FacadeSurfaces,
    u: [f32; 2],
    floor: f32,
) {
    balcony(b, plan, style, looks, u, floor + 0.05, 0.7);
    for at in cuts_of([u[0] + 0.3, u[1] - 0.3], style.bay_m) {
        block(b, plan, [at - 0.09, at + 0.09], [floor - 0.42, floor - 0.1], [0.0, 0.5], looks.trim);
    }
}

fn balcony(
    b: &mut SceneBuilder,
    plan: WallFrame<'_>,
    style: &Style,
    looks: &FacadeSurfaces,
    u: [f32; 2],
    floor: f32,
    reach: f32,
) {
    course(b, plan, u, [floor - 0.16, floor], [-0.05, reach], looks.trim);
    let out = reach - 0.06;
    let path = |share: &[f32]| -> Vec<[f32; 2]> {
        let front = share.iter().map(|u| [*u, out]);
        std::iter::once([u[0], 0.05]).chain(front).chain([[u[1], 0.05]]).collect()
    };
    for pair in path(&cuts_of(u, 2.5)).windows(2) {
        railing(b, plan, style, looks, [pair[0], pair[1]], floor);
    }
}

/// One straight section of a railing between two positions (u and out) at a floor.
fn railing(
    b: &mut SceneBuilder,
    plan: WallFrame<'_>,
    style: &Style,
    looks: &FacadeSurfaces,
    ends: [[f32; 2]; 2],
    floor: f32,
) {
    let at = |[u, out]: [f32; 2], up: f32| plan(u, floor + up, out);
    let [from, to] = ends;
    match style.rail {
        Rail::Bars => {
            for up in [0.1, RAIL_M] {
                b.add(Shape::cylinder(at(from, up), at(to, up), 0.02), looks.iron);
            }
            let length = ((to[0] - from[0]).powi(2) + (to[1] - from[1]).powi(2)).sqrt();
            let n = (length / GAP_M).ceil() as usize;
            for i in 0..n {
                let share = i as f32 / n as f32;
                let place = [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])];
                b.add(Shape::cylinder(at(place, 0.0), at(place, RAIL_M), 0.009), looks.iron);
            }
        }
        Rail::Glass => {
            b.quad([at(from, 0.08), at(to, 0.08), at(to, RAIL_M), at(from, RAIL_M)], looks.glass);
            b.add(Shape::cylinder(at(from, RAIL_M), at(to, RAIL_M), 0.025), looks.iron);
            for end in ends {
                b.add(Shape::cylinder(at(end, 0.0), at(end, RAIL_M), 0.02), looks.iron);
            }
        }
        Rail::Solid => {
            let middle = |end: [f32; 2]| at(end, 0.5 * RAIL_M);
            b.add(super::frame::beam(&middle(from), &middle(to), [0.1, RAIL_M]), looks.trim);
        }
    }
}
