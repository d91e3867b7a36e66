//! Objects other than houses and furniture: scaffolding, market stalls, tents. Class other.

use super::frame::Frame;
use crate::material::Material;
use crate::scene_builder::SceneBuilder;
use messages::ClassId::Other;
use nalgebra::Isometry3;
use random::Random;

/// A scaffold in front of a facade: `length_m` along x from the origin, three storeys, the wall on +y.
pub fn scaffolding(b: &mut SceneBuilder, pose: &Isometry3<f32>, length_m: f32) {
    let mut f = Frame::new(b, pose);
    let [steel, planks, net] =
        [Material::Steel, Material::WoodGray, Material::GreenPlastic].map(|m| f.surface(Other, m));
    let n = (length_m / 2.0).round().max(1.0) as usize;
    let at = |i: usize| length_m * i as f32 / n as f32;
    for i in 0..=n {
        for y in [-0.45, 0.45] {
            f.tube([at(i), y, 0.0], [at(i), y, 7.4], 0.024, steel);
        }
    }
    for level in 1..=3 {
        let z = 2.2 * level as f32;
        f.cuboid([0.0, -0.45, z - 0.04], [length_m, 0.45, z], planks);
        for up in [0.5, 1.0] {
            f.tube([0.0, -0.45, z + up], [length_m, -0.45, z + up], 0.024, steel);
        }
    }
    for i in 0..n {
        let z = 2.2 * (i % 3) as f32;
        f.tube([at(i), -0.47, z], [at(i + 1), -0.47, z + 2.2], 0.024, steel);
    }
    f.mesh([[0.0, -0.5, 4.4], [length_m, -0.5, 4.4], [0.0, -0.5, 7.4]], 0.35, net);
}

/// A market stall of 3 by 2 m: a table with goods under a cloth roof.
pub fn market_stall(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let cloth = *random.pick(&[Material::RedCloth, Material::BlueCloth, Material::GreenCloth, Material::WhiteCloth]);
    let [cloth, white, wood, steel] =
        [cloth, Material::WhiteCloth, Material::Wood, Material::Steel].map(|m| f.surface(Other, m));
    for [x, y, top] in [[-1.5, -1.0, 2.2], [1.5, -1.0, 2.2], [-1.5, 1.0, 2.6], [1.5, 1.0, 2.6]] {
        f.tube([x, y, 0.0], [x, y, top], 0.025, steel);
    }
    for i in 0..6 {
        let x = -1.65 + 0.55 * i as f32;
        let strip = if i % 2 == 0 { cloth } else { white };
        f.quad([[x, -1.3, 2.14], [x + 0.55, -1.3, 2.14], [x + 0.55, 1.1, 2.62], [x, 1.1, 2.62]], strip);
        f.quad([[x, -1.3, 2.14], [x + 0.55, -1.3, 2.14], [x + 0.55, -1.31, 1.92], [x, -1.31, 1.92]], strip);
    }
    f.cuboid([-1.45, -0.95, 0.75], [1.45, 0.1, 0.8], wood);
    f.cuboid([-1.45, -0.97, 0.05], [1.45, -0.95, 0.78], cloth);
    for i in 0..10 {
        let x = -1.2 + 0.6 * (i % 5) as f32;
        let y = -0.7 + 0.45 * (i / 5) as f32;
        let goods = *random.pick(&[Material::OrangePlastic, Material::LeavesYoung, Material::RedCloth, Material::Wood]);
        let goods = f.surface(Other, goods);
        f.cuboid([x - 0.22, y - 0.17, 0.8], [x + 0.22, y + 0.17, 0.92], wood);
        for k in 0..4 {
            f.ball([x - 0.11 + 0.22 * (k % 2) as f32, y - 0.08 + 0.16 * (k / 2) as f32, 0.95], 0.08, goods);
        }
    }
}

/// A tent of 3 by 3 m with open sides and a pointed roof.
pub fn tent(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let cloth = *random.pick(&[Material::WhiteCloth, Material::BeigeCloth, Material::RedCloth]);
    let [cloth, steel] = [f.surface(Other, cloth), f.surface(Other, Material::Steel)];
    let corners = [[-1.5, -1.5], [1.5, -1.5], [1.5, 1.5], [-1.5, 1.5]];
    for i in 0..4 {
        let [ax, ay] = corners[i];
        let [cx, cy] = corners[(i + 1) % 4];
        f.tube([ax, ay, 0.0], [ax, ay, 2.2], 0.03, steel);
        f.triangle([[ax, ay, 2.2], [cx, cy, 2.2], [0.0, 0.0, 3.2]], cloth);
        f.quad([[ax, ay, 2.2], [cx, cy, 2.2], [cx, cy, 1.95], [ax, ay, 1.95]], cloth);
    }
    f.quad([[-1.5, 1.5, 0.0], [1.5, 1.5, 0.0], [1.5, 1.5, 2.0], [-1.5, 1.5, 2.0]], cloth);
}

/// A skip for rubble, 3 by 1.7 m.
pub fn skip(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let paint = *random.pick(&[Material::PaintYellow, Material::PaintBlue, Material::Rust]);
    let [paint, rubble] = [f.surface(Other, paint), f.surface(Other, Material::Fieldstone)];
    let ring = |z: f32, x: f32, y: f32| [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]];
    let [low, high] = [ring(0.05, 0.95, 0.8), ring(1.25, 1.5, 0.85)];
    for i in 0..4 {
        let j = (i + 1) % 4;
        f.quad([low[i], low[j], high[j], high[i]], paint);
    }
    f.quad(ring(0.9, 1.35, 0.82), rubble);
    for _ in 0..8 {
        let at = [random.range(-1.0, 1.0), random.range(-0.5, 0.5), random.range(0.85, 1.05)];
        f.ball(at, random.range(0.1, 0.25), rubble);
    }
}
