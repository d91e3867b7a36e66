//! Permanent street furniture: benches, shelters, columns, hydrants, racks.

use super::frame::Frame;
use crate::material::Material;
use crate::scene_builder::SceneBuilder;
use messages::ClassId::{Static, Water};
use nalgebra::Isometry3;
use random::Random;
use std::f32::consts::TAU;

/// A bench of planks on iron legs; its back is on the frame's +y.
pub fn bench(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let wood = *random.pick(&[Material::Wood, Material::WoodGreen, Material::WoodGray]);
    let [wood, iron] = [f.surface(Static, wood), f.surface(Static, Material::DarkMetal)];
    for plank in 0..4 {
        let y = -0.25 + 0.115 * plank as f32;
        f.cuboid([-0.9, y, 0.42], [0.9, y + 0.095, 0.46], wood);
    }
    for plank in 0..3 {
        let y = 0.23 + 0.03 * plank as f32;
        let z = 0.55 + 0.125 * plank as f32;
        f.beam([-0.9, y, z], [0.9, y, z], [0.03, 0.1], wood);
    }
    for x in [-0.75, 0.0, 0.75] {
        f.beam([x, -0.22, -0.02], [x, -0.2, 0.42], [0.05, 0.05], iron);
        f.beam([x, 0.2, -0.02], [x, 0.2, 0.45], [0.05, 0.05], iron);
        f.beam([x, 0.2, 0.43], [x, 0.31, 0.88], [0.05, 0.04], iron);
        f.beam([x, -0.24, 0.4], [x, 0.24, 0.4], [0.05, 0.04], iron);
    }
}

/// A bus shelter of 4 m: glass on three sides, a roof, a seat, a poster. Open towards -y.
pub fn bus_shelter(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let [steel, glass, seat] = [Material::DarkMetal, Material::Glass, Material::Wood].map(|m| f.surface(Static, m));
    let poster = *random.pick(&[Material::RedCloth, Material::BlueCloth, Material::YellowCloth, Material::WhiteCloth]);
    let poster = f.surface(Static, poster);
    for x in [-2.0, -0.67, 0.67, 2.0] {
        f.tube([x, 0.6, -0.2], [x, 0.6, 2.35], 0.04, steel);
    }
    f.tube([-2.0, -0.5, -0.2], [-2.0, -0.5, 2.35], 0.04, steel);
    for x in [-2.0, -0.67, 0.67] {
        f.cuboid([x + 0.06, 0.59, 0.3], [x + 1.27, 0.61, 2.1], glass);
    }
    f.cuboid([-2.01, -0.4, 0.3], [-1.99, 0.5, 2.1], glass);
    f.cuboid([-2.15, -0.75, 2.35], [2.15, 0.75, 2.47], steel);
    f.cuboid([-1.7, 0.2, 0.45], [0.9, 0.5, 0.5], seat);
    for x in [-1.5, 0.7] {
        f.beam([x, 0.35, -0.05], [x, 0.35, 0.45], [0.08, 0.08], steel);
    }
    f.cuboid([1.92, -0.6, 0.35], [2.08, 0.62, 2.15], steel);
    f.cuboid([1.9, -0.5, 0.5], [2.1, 0.5, 2.05], poster);
}

/// A round column for posters under a dome, 4.2 m, as in Paris.
pub fn advertising_column(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let green = f.surface(Static, Material::GreenMetal);
    f.tube([0.0, 0.0, -0.2], [0.0, 0.0, 0.5], 0.72, green);
    f.tube([0.0, 0.0, 0.5], [0.0, 0.0, 3.1], 0.62, green);
    for i in 0..6 {
        let cloth = *random.pick(&[
            Material::RedCloth,
            Material::BlueCloth,
            Material::YellowCloth,
            Material::WhiteCloth,
            Material::BlackCloth,
            Material::BeigeCloth,
        ]);
        let poster = f.surface(Static, cloth);
        let mut part = f.part([0.0, 0.0, 0.0], TAU * i as f32 / 6.0);
        part.cuboid([0.545, -0.28, 0.75], [0.635, 0.28, 2.85], poster);
    }
    f.cone([0.0, 0.0, 3.1], [0.0, 0.0, 3.3], [0.65, 0.9], green);
    f.cone([0.0, 0.0, 3.3], [0.0, 0.0, 3.75], [0.88, 0.5], green);
    f.cone([0.0, 0.0, 3.75], [0.0, 0.0, 4.05], [0.5, 0.12], green);
    f.ball([0.0, 0.0, 4.12], 0.12, green);
}

/// A newspaper kiosk of 3 by 2.2 m with an open counter towards -y.
pub fn kiosk(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let [green, glass, wood] = [Material::GreenMetal, Material::Glass, Material::Wood].map(|m| f.surface(Static, m));
    f.cuboid([-1.5, -0.9, -0.2], [1.5, 1.1, 0.95], green);
    for [x, y] in [[-1.42, -0.82], [1.42, -0.82], [-1.42, 1.02], [1.42, 1.02]] {
        f.cuboid([x - 0.08, y - 0.08, 0.95], [x + 0.08, y + 0.08, 2.4], green);
    }
    f.cuboid([-1.34, 1.0, 0.95], [1.34, 1.05, 2.4], green);
    for x in [-1.42, 1.4] {
        f.cuboid([x, -0.74, 0.95], [x + 0.02, 0.94, 2.4], glass);
    }
    f.cuboid([-1.6, -1.15, 0.93], [1.6, -0.85, 0.98], wood);
    for i in 0..9 {
        let paper =
            *random.pick(&[Material::RedCloth, Material::BlueCloth, Material::YellowCloth, Material::WhiteCloth]);
        let paper = f.surface(Static, paper);
        let x = -1.35 + 0.3 * i as f32;
        f.cuboid([x, -0.92, 0.3], [x + 0.24, -0.9, 0.62], paper);
        f.cuboid([x, 0.7, 1.2], [x + 0.24, 0.72, 1.9], paper);
    }
    f.cuboid([-1.75, -1.35, 2.4], [1.75, 1.25, 2.55], green);
    f.cone([0.0, -0.05, 2.55], [0.0, -0.05, 3.1], [1.2, 0.3], green);
    f.quad([[-1.5, -0.9, 2.38], [1.5, -0.9, 2.38], [1.5, -1.7, 2.15], [-1.5, -1.7, 2.15]], green);
}

/// A letter box: yellow, on a foot, its slot towards -y.
pub fn mailbox(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let paint = *random.pick(&[Material::PaintYellow, Material::PaintYellow, Material::PaintRed]);
    let [paint, dark] = [f.surface(Static, paint), f.surface(Static, Material::BlackPlastic)];
    f.cuboid([-0.12, -0.12, -0.1], [0.12, 0.12, 0.35], dark);
    f.cuboid([-0.24, -0.2, 0.35], [0.24, 0.2, 1.3], paint);
    f.tube([-0.24, 0.0, 1.3], [0.24, 0.0, 1.3], 0.2, paint);
    f.cuboid([-0.17, -0.21, 1.12], [0.17, -0.19, 1.16], dark);
}

/// A hydrant of 0.8 m.
pub fn hydrant(b: &mut SceneBuilder, pose: &Isometry3<f32>, _: &mut Random) {
    let mut f = Frame::new(b, pose);
    let [red, cap] = [f.surface(Static, Material::PaintRed), f.surface(Static, Material::Steel)];
    f.tube([0.0, 0.0, -0.1], [0.0, 0.0, 0.06], 0.17, red);
    f.tube([0.0, 0.0, 0.06], [0.0, 0.0, 0.62], 0.11, red);
    f.ball([0.0, 0.0, 0.62], 0.12, red);
    f.tube([0.0, 0.0, 0.7], [0.0, 0.0, 0.8], 0.035, cap);
    for side in [-1.0_f32, 1.0] {
        f.tube([0.0, 0.0, 0.48], [0.0, side * 0.19, 0.48], 0.055, red);
        f.tube([0.0, side * 0.19, 0.48], [0.0, side * 0.22, 0.48], 0.065, cap);
    }
    f.tube([0.0, 0.0, 0.4], [-0.2, 0.0, 0.4], 0.07, cap);
}

/// A round fountain of 2 to 3.5 m radius: a stone basin with water, a column with a bowl, jets.
pub fn fountain(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    const RIM: usize = 24;
    let mut f = Frame::new(b, pose);
    let [stone, water] = [f.surface(Static, Material::LimestoneDressed), f.surface(Water, Material::Water)];
    let radius = random.range(2.0, 3.5);
    f.tube([0.0, 0.0, -0.3], [0.0, 0.0, 0.38], radius - 0.15, water);
    for i in 0..RIM {
        let corner = |i: usize, out: f32| {
            let angle = TAU * i as f32 / RIM as f32;
            [out * angle.cos(), out * angle.sin()]
        };
        let [ax, ay] = corner(i, radius);
        let [cx, cy] = corner(i + 1, radius);
        f.beam([ax, ay, 0.1], [cx, cy, 0.1], [0.3, 0.8], stone);
        f.beam([ax, ay, 0.53], [cx, cy, 0.53], [0.46, 0.1], stone);
    }
    f.cone([0.0, 0.0, 0.0], [0.0, 0.0, 0.7], [0.55, 0.35], stone);
    f.tube([0.0, 0.0, 0.7], [0.0, 0.0, 1.35], 0.2, stone);
    f.cone([0.0, 0.0, 1.35], [0.0, 0.0, 1.65], [0.25, 0.95], stone);
    f.tube([0.0, 0.0, 1.65], [0.0, 0.0, 1.67], 0.88, water);
    f.cone([0.0, 0.0, 1.6], [0.0, 0.0, 2.3], [0.18, 0.1], stone);
    f.ball([0.0, 0.0, 2.38], 0.16, stone);
    for i in 0..8 {
        let angle = TAU * i as f32 / 8.0;
        let c = angle.cos();
        let s = angle.sin();
        // Falling water: drops that some rays pass.
        for step in 0..4 {
            let share = step as f32 / 3.0;
            let out = 0.95 + 0.35 * share;
            f.leaves([out * c, out * s, 1.6 - 1.05 * share * share], 0.06, 0.15, water);
        }
    }
}

/// Steel hoops for bicycles, 0.8 m apart along x.
pub fn bicycle_rack(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let steel = f.surface(Static, Material::Steel);
    for i in 0..3 + random.index(3) {
        let x = 0.8 * i as f32;
        for y in [-0.35, 0.35] {
            f.tube([x, y, -0.1], [x, y, 0.72], 0.024, steel);
        }
        f.tube([x, -0.35, 0.72], [x, -0.25, 0.82], 0.024, steel);
        f.tube([x, 0.35, 0.72], [x, 0.25, 0.82], 0.024, steel);
        f.tube([x, -0.25, 0.82], [x, 0.25, 0.82], 0.024, steel);
    }
}

/// A parking meter or a cabinet of the power company.
pub fn cabinet(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let [gray, dark] = [f.surface(Static, Material::PlasterGray), f.surface(Static, Material::DarkMetal)];
    if random.chance(0.5) {
        f.cuboid([-0.13, -0.1, -0.1], [0.13, 0.1, 1.1], dark);
        f.cuboid([-0.19, -0.15, 1.1], [0.19, 0.15, 1.65], dark);
        let screen = f.surface(Static, Material::BluePlastic);
        f.cuboid([-0.12, -0.16, 1.35], [0.12, -0.14, 1.55], screen);
    } else {
        let wide = random.range(0.5, 0.9);
        f.cuboid([-wide, -0.18, -0.1], [wide, 0.2, 0.12], dark);
        f.cuboid([-wide - 0.02, -0.2, 0.12], [wide + 0.02, 0.22, 1.25], gray);
        f.cuboid([-0.01, -0.21, 0.15], [0.01, -0.19, 1.2], dark);
    }
}

/// A statue of stone on a plinth, 4 m.
pub fn statue(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let [stone, bronze] = [f.surface(Static, Material::LimestoneDressed), f.surface(Static, Material::GreenMetal)];
    f.cuboid([-0.9, -0.9, -0.3], [0.9, 0.9, 0.3], stone);
    f.cuboid([-0.6, -0.6, 0.3], [0.6, 0.6, 1.7], stone);
    f.cuboid([-0.72, -0.72, 1.7], [0.72, 0.72, 1.88], stone);
    let turn = random.range(0.0, TAU);
    let mut figure = f.part([0.0, 0.0, 1.88], turn);
    figure.cone([0.0, 0.0, 0.0], [0.0, 0.0, 1.15], [0.4, 0.22], bronze);
    figure.cone([0.0, 0.0, 1.1], [0.0, 0.0, 1.65], [0.2, 0.28], bronze);
    figure.tube([0.0, 0.0, 1.6], [0.02, 0.0, 1.85], 0.08, bronze);
    figure.ball([0.02, 0.0, 1.92], 0.15, bronze);
    figure.tube([0.0, 0.26, 1.6], [0.35, 0.32, 1.75], 0.065, bronze);
    figure.tube([0.0, -0.26, 1.6], [0.1, -0.36, 1.05], 0.065, bronze);
}
