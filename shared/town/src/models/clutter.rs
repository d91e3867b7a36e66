//! Objects that may be moved from day to day: bins, bags, cones, cafe tables, crates, buggies. Class dynamic.

use super::frame::Frame;
use crate::material::Material;
use crate::scene_builder::SceneBuilder;
use messages::ClassId::Dynamic;
use nalgebra::Isometry3;
use random::Random;
use std::f32::consts::TAU;

/// A wheeled bin of 1.1 m with its front towards -x.
pub fn bin(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let lid = *random.pick(&[Material::GreenPlastic, Material::YellowPlastic, Material::BluePlastic]);
    let [body, lid, rubber] = [Material::GreenPlastic, lid, Material::Rubber].map(|m| f.surface(Dynamic, m));
    // Wider at the top than at the bottom: four slanted walls.
    let ring = |z: f32, grow: f32| {
        let [x, y] = [0.26 + grow, 0.24 + grow];
        [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]]
    };
    let [low, high] = [ring(0.1, 0.0), ring(0.98, 0.06)];
    for i in 0..4 {
        let j = (i + 1) % 4;
        f.quad([low[i], low[j], high[j], high[i]], body);
    }
    f.cuboid([-0.35, -0.31, 0.98], [0.36, 0.31, 1.06], lid);
    f.tube([0.34, -0.22, 0.99], [0.34, 0.22, 0.99], 0.02, body);
    for y in [-0.26, 0.2] {
        f.tube([0.25, y, 0.1], [0.25, y + 0.06, 0.1], 0.1, rubber);
    }
    f.cuboid([-0.26, -0.22, 0.0], [-0.1, 0.22, 0.1], body);
}

/// A refuse container of 1.4 m on four wheels.
pub fn container(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let body = *random.pick(&[Material::GreenPlastic, Material::PaintGray]);
    let [body, lid, rubber] = [body, Material::BlackPlastic, Material::Rubber].map(|m| f.surface(Dynamic, m));
    f.cuboid([-0.65, -0.42, 0.22], [0.65, 0.42, 1.15], body);
    f.tube([-0.68, 0.0, 1.1], [0.68, 0.0, 1.1], 0.4, lid);
    for [x, y] in [[-0.5, -0.3], [0.5, -0.3], [-0.5, 0.3], [0.5, 0.3]] {
        f.tube([x, y - 0.03, 0.1], [x, y + 0.03, 0.1], 0.1, rubber);
        f.cuboid([x - 0.04, y - 0.05, 0.15], [x + 0.04, y + 0.05, 0.23], lid);
    }
}

/// A heap of full refuse bags.
pub fn bags(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    for _ in 0..3 + random.index(4) {
        let skin = *random.pick(&[Material::BlackPlastic, Material::BluePlastic, Material::BlackPlastic]);
        let skin = f.surface(Dynamic, skin);
        let x = random.range(-0.5, 0.5);
        let y = random.range(-0.3, 0.3);
        let size = random.range(0.18, 0.28);
        f.ball([x, y, 0.85 * size], size, skin);
        f.cone([x, y, 1.6 * size], [x + 0.03, y, 2.3 * size], [0.5 * size, 0.06], skin);
    }
}

/// A traffic cone.
pub fn cone(b: &mut SceneBuilder, pose: &Isometry3<f32>, _: &mut Random) {
    let mut f = Frame::new(b, pose);
    let [orange, white] = [f.surface(Dynamic, Material::OrangePlastic), f.surface(Dynamic, Material::SignWhite)];
    f.cuboid([-0.18, -0.18, 0.0], [0.18, 0.18, 0.03], orange);
    f.cone([0.0, 0.0, 0.03], [0.0, 0.0, 0.7], [0.13, 0.03], orange);
    f.cone([0.0, 0.0, 0.3], [0.0, 0.0, 0.45], [0.098, 0.074], white);
}

/// A cafe table with two to four chairs, sometimes under a parasol.
pub fn cafe_table(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let top = *random.pick(&[Material::Wood, Material::WhitePlastic, Material::Steel]);
    let [top, iron] = [f.surface(Dynamic, top), f.surface(Dynamic, Material::DarkMetal)];
    f.tube([0.0, 0.0, 0.7], [0.0, 0.0, 0.73], 0.35, top);
    f.tube([0.0, 0.0, 0.03], [0.0, 0.0, 0.7], 0.03, iron);
    f.tube([0.0, 0.0, 0.0], [0.0, 0.0, 0.03], 0.22, iron);
    let seat = *random.pick(&[Material::Wood, Material::WoodRed, Material::WoodGreen]);
    let n = 2 + random.index(3);
    let turn = random.range(0.0, TAU);
    for i in 0..n {
        let yaw = turn + TAU * i as f32 / n as f32;
        let at = [0.62 * yaw.cos(), 0.62 * yaw.sin(), 0.0];
        chair(&mut f.part(at, yaw + random.range(-0.2, 0.2)), seat);
    }
    if random.chance(0.3) {
        let cloth = *random.pick(&[Material::RedCloth, Material::BeigeCloth, Material::GreenCloth]);
        let cloth = f.surface(Dynamic, cloth);
        f.tube([0.0, 0.0, 0.73], [0.0, 0.0, 2.3], 0.022, iron);
        f.cone([0.0, 0.0, 2.05], [0.0, 0.0, 2.45], [1.2, 0.05], cloth);
    }
}

/// A chair with its back on the frame's +x.
fn chair(f: &mut Frame<'_>, material: Material) {
    let [wood, iron] = [f.surface(Dynamic, material), f.surface(Dynamic, Material::DarkMetal)];
    f.cuboid([-0.2, -0.2, 0.43], [0.2, 0.2, 0.46], wood);
    for [x, y] in [[-0.18, -0.18], [-0.18, 0.18], [0.18, -0.18], [0.18, 0.18]] {
        f.tube([x, y, 0.0], [x, y, if x > 0.0 { 0.85 } else { 0.43 }], 0.014, iron);
    }
    f.cuboid([0.17, -0.19, 0.62], [0.2, 0.19, 0.84], wood);
}

/// Crates and cartons in front of a shop, some with fruit.
pub fn crates(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    for i in 0..3 {
        let x = -0.6 + 0.6 * i as f32;
        for level in 0..=random.index(3) {
            let board = *random.pick(&[Material::Wood, Material::BeigeCloth, Material::BluePlastic]);
            let board = f.surface(Dynamic, board);
            let z = 0.26 * level as f32;
            let off = random.range(-0.04, 0.04);
            f.cuboid([x + off, -0.2, z], [x + off + 0.52, 0.2, z + 0.24], board);
        }
        if random.chance(0.4) {
            let fruit = *random.pick(&[Material::OrangePlastic, Material::RedCloth, Material::LeavesYoung]);
            let fruit = f.surface(Dynamic, fruit);
            for k in 0..6 {
                let at = [x + 0.1 + 0.15 * (k % 3) as f32, -0.1 + 0.18 * (k / 3) as f32, 0.8];
                f.ball(at, 0.05, fruit);
            }
            let board = f.surface(Dynamic, Material::Wood);
            f.cuboid([x, -0.2, 0.0], [x + 0.5, 0.2, 0.77], board);
        }
    }
}

/// A sandwich board of a shop on the sidewalk, 1 m high.
pub fn sandwich_board(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let face = *random.pick(&[Material::BlackCloth, Material::WhitePlastic, Material::WoodRed]);
    let [face, wood] = [f.surface(Dynamic, face), f.surface(Dynamic, Material::Wood)];
    for side in [-1.0_f32, 1.0] {
        f.quad(
            [[side * 0.25, -0.3, 0.1], [side * 0.25, 0.3, 0.1], [side * 0.02, 0.3, 1.0], [side * 0.02, -0.3, 1.0]],
            face,
        );
        for y in [-0.31, 0.31] {
            f.beam([side * 0.27, y, 0.0], [side * 0.02, y, 1.02], [0.04, 0.04], wood);
        }
    }
}

/// A red-and-white barrier of a building site, 2 m long.
pub fn barrier(b: &mut SceneBuilder, pose: &Isometry3<f32>, _: &mut Random) {
    let mut f = Frame::new(b, pose);
    let [red, white, rubber] =
        [Material::SignRed, Material::SignWhite, Material::Rubber].map(|m| f.surface(Dynamic, m));
    for x in [-0.9, 0.9] {
        f.cuboid([x - 0.06, -0.3, 0.0], [x + 0.06, 0.3, 0.08], rubber);
        f.beam([x, 0.0, 0.08], [x, 0.0, 1.05], [0.05, 0.05], white);
    }
    for i in 0..8 {
        let x = -1.0 + 0.25 * i as f32;
        for z in [0.45, 0.85] {
            f.cuboid([x, -0.02, z], [x + 0.25, 0.02, z + 0.15], if i % 2 == 0 { red } else { white });
        }
    }
}
