//! Houses: uneven walls with recessed windows, doors, mouldings and balconies.
//!
//! A wall is a grid over `u` (along) and `z` (up) whose corners are moved in and out by noise, so that no wall is a plane;
//! plastered and stone walls of old streets are out by centimetres.

use crate::material::Material;
use crate::noise::rough;
use crate::random::Random;
use crate::scene::builder::{Builder, SurfaceId};
use crate::trace::{Shape, Vec3};
use messages::ClassId;

/// Where a wall stands: a place along it, up, and outward (m) to the world.
pub type Plan<'a> = &'a dyn Fn(f32, f32, f32) -> Vec3;

/// The measures of a wall.
#[derive(Clone, Copy, Debug)]
pub struct Wall {
    /// Length, m.
    pub length: f32,
    /// Storeys.
    pub floors: usize,
    /// Of the wall.
    pub material: Material,
    /// Whether it has balconies.
    pub balconies: bool,
    /// Of its unevenness.
    pub seed: u64,
}

/// Height of a storey, m.
pub const FLOOR_M: f32 = 3.1;
/// How deep windows lie in the wall, m.
const RECESS_M: f32 = 0.22;
/// How far the wall reaches into the ground, m.
const FOOT_M: f32 = 0.7;
/// Half of the unevenness, m: 4 cm in all on most walls.
pub const UNEVEN_M: f32 = 0.03;

struct Looks {
    wall: SurfaceId,
    trim: SurfaceId,
    glass: SurfaceId,
    door: SurfaceId,
    rail: SurfaceId,
}

/// A wall with windows. Mouldings and balconies stand out of it.
pub fn build(b: &mut Builder, plan: Plan<'_>, wall: &Wall, random: &mut Random) {
    let looks = Looks {
        wall: b.surface(ClassId::Building, 0, wall.material),
        trim: b.surface(ClassId::Building, 0, random.pick([Material::Limestone, Material::PlasterGray])),
        glass: b.surface(ClassId::Building, 0, Material::Glass),
        door: b.surface(ClassId::Building, 0, random.pick([Material::Wood, Material::PaintBlue, Material::DarkMetal])),
        rail: b.surface(ClassId::Building, 0, Material::DarkMetal),
    };
    let n_bays = (wall.length / random.range(2.7, 3.5)).round().max(1.0) as usize;
    let bay = wall.length / n_bays as f32;
    let with_balcony = wall.balconies && random.chance(0.6);
    let door_bay = random.index(n_bays);
    for floor in 0..wall.floors {
        for column in 0..n_bays {
            let is_door = floor == 0 && column == door_bay;
            let hole = opening(bay, floor, is_door);
            let at = [column as f32 * bay, floor as f32 * FLOOR_M];
            panel(b, plan, wall, &looks, at, bay, &hole, is_door);
            if with_balcony && floor > 0 && (floor + column) % 2 == 0 {
                balcony(b, plan, &looks, at, &hole);
            }
        }
        moulding(b, plan, wall.length, (floor + 1) as f32 * FLOOR_M - 0.2, looks.trim);
    }
    foot(b, plan, wall, looks.wall);
}

/// A window or door inside a bay: its edges from the bay's lower left corner, m.
struct Opening {
    u: [f32; 2],
    z: [f32; 2],
}

fn opening(bay: f32, floor: usize, is_door: bool) -> Opening {
    let half = if is_door {
        0.6
    } else if floor == 0 {
        0.36 * bay
    } else {
        0.19 * bay
    };
    let z = match (floor, is_door) {
        (_, true) => [0.0, 2.3],
        (0, false) => [0.7, 2.4],
        _ => [0.75, 2.45],
    };
    Opening { u: [0.5 * bay - half, 0.5 * bay + half], z }
}

/// One bay of one storey: wall around an opening, the reveals and the pane.
#[allow(clippy::too_many_arguments, reason = "one place, one measure and one look each; a struct would be used once")]
fn panel(
    b: &mut Builder,
    plan: Plan<'_>,
    wall: &Wall,
    looks: &Looks,
    [u0, z0]: [f32; 2],
    bay: f32,
    hole: &Opening,
    is_door: bool,
) {
    let us = [0.0, 0.5 * hole.u[0], hole.u[0], 0.5 * bay, hole.u[1], 0.5 * (hole.u[1] + bay), bay];
    let zs = [0.0, 0.5 * hole.z[0], hole.z[0], 0.5 * (hole.z[0] + hole.z[1]), hole.z[1], FLOOR_M];
    let point = |u: f32, z: f32, out: f32| plan(u0 + u, z0 + z, out + uneven(wall, u0 + u, z0 + z));
    for u in us.windows(2) {
        for z in zs.windows(2) {
            let inside = u[0] >= hole.u[0] && u[1] <= hole.u[1] && z[0] >= hole.z[0] && z[1] <= hole.z[1];
            if inside || z[1] - z[0] < 1e-3 {
                continue;
            }
            let corners = [(u[0], z[0]), (u[1], z[0]), (u[1], z[1]), (u[0], z[1])];
            b.quad(corners.map(|(u, z)| point(u, z, 0.0)), looks.wall);
        }
    }
    let rim = [(hole.u[0], hole.z[0]), (hole.u[1], hole.z[0]), (hole.u[1], hole.z[1]), (hole.u[0], hole.z[1])];
    for i in 0..4 {
        let ((ua, za), (ub, zb)) = (rim[i], rim[(i + 1) % 4]);
        let quad = [point(ua, za, 0.0), point(ub, zb, 0.0), point(ub, zb, -RECESS_M), point(ua, za, -RECESS_M)];
        b.quad(quad, looks.trim);
    }
    let pane = rim.map(|(u, z)| point(u, z, -RECESS_M));
    b.quad(pane, if is_door { looks.door } else { looks.glass });
    if !is_door {
        frame(b, &|u, z, out| point(u, z, out), looks.trim, hole);
    }
}

/// The window's frame: a post and two rails in front of the pane, which the lidar sees where glass lets it pass.
fn frame(b: &mut Builder, point: &dyn Fn(f32, f32, f32) -> Vec3, surface: SurfaceId, hole: &Opening) {
    let bar = 0.045;
    let middle = 0.5 * (hole.u[0] + hole.u[1]);
    let bars = [
        ([middle - bar, middle + bar], hole.z),
        (hole.u, [hole.z[0], hole.z[0] + 2.0 * bar]),
        (hole.u, [hole.z[1] - 2.0 * bar, hole.z[1]]),
    ];
    for ([u0, u1], [z0, z1]) in bars {
        b.quad([(u0, z0), (u1, z0), (u1, z1), (u0, z1)].map(|(u, z)| point(u, z, 0.04 - RECESS_M)), surface);
    }
}

fn uneven(wall: &Wall, u: f32, z: f32) -> f32 {
    UNEVEN_M * rough(wall.seed, u, z, 4.3, 1.1)
}

/// A course of stone that stands out 10 cm above each storey.
fn moulding(b: &mut Builder, plan: Plan<'_>, length: f32, z: f32, surface: SurfaceId) {
    bar(b, plan, [0.0, length], [z, z + 0.18], [-0.05, 0.1], surface);
}

/// A straight bar along the wall, cut every 2 m so that it follows a curved one.
fn bar(b: &mut Builder, plan: Plan<'_>, u: [f32; 2], z: [f32; 2], out: [f32; 2], surface: SurfaceId) {
    let n = ((u[1] - u[0]) / 2.0).ceil().max(1.0) as usize;
    let at = |i: usize| u[0] + (u[1] - u[0]) * i as f32 / n as f32;
    for i in 0..n {
        let (a, c) = (at(i), at(i + 1));
        let face =
            |z0: f32, o0: f32, z1: f32, o1: f32| [plan(a, z0, o0), plan(c, z0, o0), plan(c, z1, o1), plan(a, z1, o1)];
        b.quad(face(z[0], out[1], z[1], out[1]), surface);
        b.quad(face(z[0], out[0], z[0], out[1]), surface);
        b.quad(face(z[1], out[0], z[1], out[1]), surface);
    }
    for end in u {
        let corners = [(z[0], out[0]), (z[0], out[1]), (z[1], out[1]), (z[1], out[0])];
        b.quad(corners.map(|(z, o)| plan(end, z, o)), surface);
    }
}

/// A slab with a railing of thin bars, which beams pass.
fn balcony(b: &mut Builder, plan: Plan<'_>, looks: &Looks, [u0, z0]: [f32; 2], hole: &Opening) {
    let (reach, u) = (0.75, [u0 + hole.u[0] - 0.35, u0 + hole.u[1] + 0.35]);
    let floor = z0 + hole.z[0] - 0.65;
    bar(b, plan, u, [floor - 0.15, floor], [0.0, reach], looks.trim);
    let mut rail = |from: [f32; 3], to: [f32; 3], radius: f32| {
        let point = |[u, z, out]: [f32; 3]| plan(u, z, out);
        b.add(Shape::cylinder(point(from), point(to), radius), looks.rail);
    };
    let (top, out) = (floor + 1.0, reach - 0.05);
    rail([u[0], top, out], [u[1], top, out], 0.025);
    let n_bars = ((u[1] - u[0]) / 0.16) as usize;
    for i in 0..=n_bars {
        let at = u[0] + (u[1] - u[0]) * i as f32 / n_bars as f32;
        rail([at, floor, out], [at, top, out], 0.009);
    }
    for end in u {
        rail([end, top, 0.0], [end, top, out], 0.02);
    }
}

/// The wall below its ground floor, where the street falls away from it.
fn foot(b: &mut Builder, plan: Plan<'_>, wall: &Wall, surface: SurfaceId) {
    let n = (wall.length / 2.0).ceil() as usize;
    for i in 0..n {
        let at = |i: usize| wall.length * i as f32 / n as f32;
        let (a, c) = (at(i), at(i + 1));
        let out = 0.02;
        b.quad([plan(a, -FOOT_M, out), plan(c, -FOOT_M, out), plan(c, 0.02, out), plan(a, 0.02, out)], surface);
    }
}
