//! Canals and ponds.

use super::line::Line;
use crate::material::Material;
use crate::noise::rough;
use crate::scene_builder::SceneBuilder;
use messages::ClassId::{Ground, Static, Terrain, Wall, Water};
use nalgebra::Isometry3;
use random::Random;
use raytrace::{Shape, Vec3};
use std::f32::consts::TAU;

/// Depth of a canal's water below its banks, m.
const DROP_M: f32 = 1.3;

/// A canal `width_m` wide along its center line, level with the banks: water between quay walls with coping stones. The
/// ground above it must be omitted.
pub fn canal(b: &mut SceneBuilder, middle: &[Vec3], width_m: f32, random: &mut Random) {
    let [water, stone, coping] = [
        b.surface(Water, 0, Material::Water),
        b.surface(Wall, 0, Material::Fieldstone),
        b.surface(Ground, 0, Material::Granite),
    ];
    let line = Line::new(middle, 1.0);
    let half = 0.5 * width_m;
    let seed = random.bits();
    let lengths = line.lengths();
    let columns = (width_m / 2.0).ceil() as usize;
    let surface: Vec<[f32; 2]> =
        (0..=columns).map(|i| [-half - 0.2 + (width_m + 0.4) * i as f32 / columns as f32, -DROP_M]).collect();
    // Ripples of 1 cm, so that the reflection of the sky differs from a plane mirror.
    line.extrude_uneven(b, &surface, water, &|foot, i| 0.02 * rough(seed, lengths[foot], surface[i][0], 1.7, 0.6));
    for side in [-1.0, 1.0] {
        let profile = [[side * half, -DROP_M - 0.3], [side * half, -0.6], [side * (half + 0.05), 0.02]];
        let uneven = |foot: usize, i: usize| 0.03 * rough(seed ^ 7, lengths[foot] + side * 900.0, i as f32, 1.3, 0.5);
        line.extrude_uneven(b, &profile, stone, &uneven);
        line.extrude(
            b,
            &[[side * half, -0.1], [side * half, 0.06], [side * (half + 0.5), 0.06], [side * (half + 0.5), -0.1]],
            coping,
        );
    }
}

/// A pond of `radius_m` in a lawn: water slightly above the ground, enclosed by a bank of stones.
pub fn pond(b: &mut SceneBuilder, pose: &Isometry3<f32>, radius_m: f32, random: &mut Random) {
    let mut f = super::frame::Frame::new(b, pose);
    let [water, stone, bank] =
        [f.surface(Water, Material::Water), f.surface(Static, Material::Granite), f.surface(Terrain, Material::Grass)];
    f.tube([0.0, 0.0, -0.3], [0.0, 0.0, 0.1], radius_m, water);
    let n = (TAU * radius_m / 0.35) as usize;
    for i in 0..n {
        let angle = TAU * i as f32 / n as f32;
        let size = random.range(0.14, 0.24);
        let c = angle.cos();
        let s = angle.sin();
        f.ball([radius_m * c, radius_m * s, 0.06], size, stone);
        if i % 2 == 0 {
            let out = radius_m + random.range(0.2, 0.5);
            f.add(
                Shape::Porous {
                    center: f.at([out * c, out * s, 0.05]),
                    radius: random.range(0.12, 0.3),
                    free_path: 0.1,
                },
                bank,
            );
        }
    }
}
