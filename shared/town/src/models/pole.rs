//! Posts: street lamps, traffic lights, bollards, utility poles. Objects mounted on a post have their own class.

use super::frame::Frame;
use crate::material::Material;
use crate::scene_builder::{SceneBuilder, SurfaceId};
use messages::ClassId::{Pole, TrafficLight};
use nalgebra::Isometry3;
use random::Random;
use raytrace::{Shape, Vec3};

/// Depth of posts in the ground, m.
const ROOT_M: f32 = 0.3;

/// A street lamp of any kind; an arm reaches along the frame's y, over the road.
pub fn lamp_post(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let kinds: [fn(&mut SceneBuilder, &Isometry3<f32>, &mut Random); 4] = [arm_lamp, arm_lamp, mast_lamp, lantern];
    random.pick(&kinds)(b, pose, random);
}

/// A post of 6.5 to 8 m with a curved arm of 1.4 m.
fn arm_lamp(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let paint = *random.pick(&[Material::DarkMetal, Material::GreenMetal, Material::Steel]);
    let [metal, lamp] = [f.surface(Pole, paint), f.surface(Pole, Material::Lamp)];
    let top = random.range(6.5, 8.0);
    f.tube([0.0, 0.0, -ROOT_M], [0.0, 0.0, 1.0], 0.11, metal);
    f.cone([0.0, 0.0, 1.0], [0.0, 0.0, top], [0.08, 0.055], metal);
    f.tube([0.0, 0.0, top], [0.0, 0.35, top + 0.3], 0.04, metal);
    f.tube([0.0, 0.35, top + 0.3], [0.0, 1.1, top + 0.42], 0.035, metal);
    f.cuboid([-0.14, 1.0, top + 0.4], [0.14, 1.65, top + 0.52], metal);
    f.cuboid([-0.11, 1.05, top + 0.37], [0.11, 1.6, top + 0.4], lamp);
}

/// A straight steel mast of 9 m with lamps to both sides, for wide roads.
fn mast_lamp(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let [metal, lamp] = [f.surface(Pole, Material::Steel), f.surface(Pole, Material::Lamp)];
    let top = random.range(8.5, 9.5);
    f.cuboid([-0.16, -0.16, -ROOT_M], [0.16, 0.16, 0.06], metal);
    f.cone([0.0, 0.0, 0.06], [0.0, 0.0, top], [0.12, 0.06], metal);
    for side in [-1.0_f32, 1.0] {
        f.tube([0.0, 0.0, top - 0.1], [0.0, side * 1.3, top + 0.15], 0.035, metal);
        f.cone([0.0, side * 1.3, top + 0.16], [0.0, side * 1.3, top + 0.02], [0.1, 0.24], metal);
        f.ball([0.0, side * 1.3, top + 0.02], 0.12, lamp);
    }
}

/// A cast-iron lantern of 3.6 m as in old quarters.
fn lantern(b: &mut SceneBuilder, pose: &Isometry3<f32>, _: &mut Random) {
    let mut f = Frame::new(b, pose);
    let [iron, lamp] = [f.surface(Pole, Material::GreenMetal), f.surface(Pole, Material::Lamp)];
    f.cone([0.0, 0.0, -ROOT_M], [0.0, 0.0, 0.25], [0.2, 0.18], iron);
    f.cone([0.0, 0.0, 0.25], [0.0, 0.0, 0.9], [0.13, 0.08], iron);
    f.ball([0.0, 0.0, 0.95], 0.1, iron);
    f.cone([0.0, 0.0, 0.95], [0.0, 0.0, 2.9], [0.06, 0.04], iron);
    f.tube([0.0, -0.25, 2.55], [0.0, 0.25, 2.55], 0.018, iron);
    f.cone([0.0, 0.0, 2.9], [0.0, 0.0, 3.35], [0.1, 0.2], lamp);
    f.cone([0.0, 0.0, 3.35], [0.0, 0.0, 3.6], [0.25, 0.05], iron);
    f.ball([0.0, 0.0, 3.63], 0.05, iron);
}

/// A traffic light on a post, its lamps towards the frame's -x, with a small one at eye level.
pub fn traffic_light(b: &mut SceneBuilder, pose: &Isometry3<f32>) {
    let mut f = Frame::new(b, pose);
    let post = f.surface(Pole, Material::DarkMetal);
    f.tube([0.0, 0.0, -ROOT_M], [0.0, 0.0, 3.35], 0.06, post);
    f.cuboid([-0.1, -0.1, 0.1], [0.1, 0.1, 0.75], post);
    signal(&mut f, [-0.16, 0.0, 2.4], 1.0);
    signal(&mut f, [-0.12, 0.0, 1.35], 0.42);
    let button = f.surface(TrafficLight, Material::YellowPlastic);
    f.cuboid([-0.05, 0.06, 1.0], [0.05, 0.16, 1.22], button);
}

/// A traffic light on a mast whose arm reaches `reach_m` along the frame's y over the road.
pub fn traffic_light_arm(b: &mut SceneBuilder, pose: &Isometry3<f32>, reach_m: f32) {
    let mut f = Frame::new(b, pose);
    let post = f.surface(Pole, Material::Steel);
    f.cone([0.0, 0.0, -ROOT_M], [0.0, 0.0, 6.2], [0.14, 0.09], post);
    f.cone([0.0, 0.0, 5.7], [0.0, reach_m, 6.1], [0.08, 0.045], post);
    f.tube([0.0, 0.0, 6.2], [0.0, 0.55 * reach_m, 5.95], 0.015, post);
    signal(&mut f, [-0.16, reach_m - 0.3, 5.35], 1.0);
    signal(&mut f, [-0.2, 0.0, 2.4], 1.0);
}

/// A box of three lamps whose foot is at `at`; 0.95 m high at scale 1.
fn signal(f: &mut Frame<'_>, [x, y, z]: [f32; 3], scale: f32) {
    let class = TrafficLight;
    let casing = f.surface(class, Material::BlackPlastic);
    let half = 0.16 * scale;
    let depth = 0.1 * scale;
    f.cuboid([x - depth, y - half, z], [x + depth, y + half, z + 0.95 * scale], casing);
    let lamps = [Material::LightGreen, Material::LightAmber, Material::LightRed];
    for (i, material) in lamps.into_iter().enumerate() {
        let lamp = f.surface(class, material);
        let up = z + scale * (0.17 + 0.3 * i as f32);
        let front = x - depth;
        f.tube([front - 0.02 * scale, y, up], [front, y, up], 0.1 * scale, lamp);
        // The visor above each lamp.
        let visor = [front - 0.14 * scale, y - 0.11 * scale, up + 0.1 * scale];
        f.cuboid(visor, [front, y + 0.11 * scale, up + 0.12 * scale], casing);
    }
}

/// A waist-high post of cast iron, or a short one of granite.
pub fn bollard(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    if random.chance(0.75) {
        let iron = f.surface(Pole, Material::DarkMetal);
        f.tube([0.0, 0.0, -ROOT_M], [0.0, 0.0, 0.95], 0.05, iron);
        f.ball([0.0, 0.0, 1.0], 0.075, iron);
    } else {
        let stone = f.surface(Pole, Material::Granite);
        f.cone([0.0, 0.0, -ROOT_M], [0.0, 0.0, 0.6], [0.17, 0.14], stone);
        f.ball([0.0, 0.0, 0.58], 0.14, stone);
    }
}

/// A delineator: a white plastic post of 1.05 m with a black band at the edge of a road.
pub fn delineator(b: &mut SceneBuilder, pose: &Isometry3<f32>) {
    let mut f = Frame::new(b, pose);
    let [white, black] = [Material::WhitePlastic, Material::BlackPlastic].map(|material| f.surface(Pole, material));
    f.cuboid([-0.04, -0.06, -ROOT_M], [0.04, 0.06, 0.75], white);
    f.cuboid([-0.04, -0.06, 0.75], [0.04, 0.06, 0.95], black);
    f.cuboid([-0.04, -0.06, 0.95], [0.04, 0.06, 1.05], white);
}

/// Height of the wires on a utility pole, m.
const WIRE_M: f32 = 7.2;
/// Distance of the two wires from the pole, m.
const WIRE_Y_M: f32 = 0.55;

/// Wooden poles at the feet, and the sagging wires between them.
pub fn utility_line(b: &mut SceneBuilder, feet: &[Vec3], random: &mut Random) {
    let wood = b.surface(Pole, 0, Material::WoodGray);
    let insulator = b.surface(Pole, 0, Material::WhitePlastic);
    let wire = b.surface(Pole, 0, Material::DarkMetal);
    for (i, foot) in feet.iter().enumerate() {
        let before = feet[i.saturating_sub(1)];
        let after = feet[(i + 1).min(feet.len() - 1)];
        let across = side_of(&before, &after);
        let top = foot + Vec3::new(random.range(-0.1, 0.1), random.range(-0.1, 0.1), WIRE_M + 0.4);
        b.add(Shape::cone(foot - Vec3::z() * ROOT_M, top, [0.15, 0.1]), wood);
        let arm = foot + Vec3::z() * (WIRE_M - 0.12);
        let reach = across * (WIRE_Y_M + 0.1);
        b.add(super::frame::beam(&(arm - reach), &(arm + reach), [0.1, 0.1]), wood);
        for side in [-1.0, 1.0] {
            let at = arm + across * (side * WIRE_Y_M);
            b.add(Shape::cylinder(at, at + Vec3::z() * 0.14, 0.035), insulator);
        }
    }
    for pair in feet.windows(2) {
        let across = side_of(&pair[0], &pair[1]);
        for side in [-1.0, 1.0] {
            sagging_wire(b, pair, &(across * (side * WIRE_Y_M)), wire);
        }
    }
}

fn side_of(from: &Vec3, to: &Vec3) -> Vec3 {
    Vec3::z().cross(&(to - from)).try_normalize(1e-6).unwrap_or_else(Vec3::y)
}

/// A parabola with a sag of 1.5 % of its span.
fn sagging_wire(b: &mut SceneBuilder, pair: &[Vec3], off: &Vec3, surface: SurfaceId) {
    const PIECES: usize = 8;
    let span = (pair[1] - pair[0]).norm();
    let at = |i: usize| {
        let share = i as f32 / PIECES as f32;
        let sag = 0.06 * span * share * (1.0 - share);
        pair[0].lerp(&pair[1], share) + off + Vec3::z() * (WIRE_M - sag)
    };
    for i in 0..PIECES {
        b.add(Shape::cylinder(at(i), at(i + 1), 0.008), surface);
    }
}
