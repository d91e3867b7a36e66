//! Detached houses and barns.

use super::builder::Builder;
use super::models::facade::{self, FLOOR_M, Wall};
use crate::material::Material;
use crate::random::Random;
use crate::trace::Vec3;
use messages::ClassId;
use nalgebra::{Isometry3, Point3};

/// A house with a gabled roof around the pose, `width` along its x and `depth` along its y, m.
pub fn detached(b: &mut Builder, pose: &Isometry3<f32>, width: f32, depth: f32, random: &mut Random) {
    let material = random.pick([Material::PlasterCream, Material::PlasterGray, Material::PlasterRose, Material::Brick]);
    build(b, pose, [width, depth], 1 + random.index(2), material, random);
}

/// A barn of wood or brick.
pub fn barn(b: &mut Builder, pose: &Isometry3<f32>, random: &mut Random) {
    let size = [random.range(14.0, 20.0), random.range(9.0, 12.0)];
    build(b, pose, size, 2, random.pick([Material::Wood, Material::Brick]), random);
}

fn build(
    b: &mut Builder,
    pose: &Isometry3<f32>,
    [width, depth]: [f32; 2],
    floors: usize,
    material: Material,
    random: &mut Random,
) {
    let at = |x: f32, y: f32, z: f32| (pose * Point3::new(x, y, z)).coords;
    let (x, y) = (0.5 * width, 0.5 * depth);
    for (turn, length, out) in [(0.0_f32, width, y), (0.5, depth, x), (1.0, width, y), (1.5, depth, x)] {
        let side = pose * Isometry3::rotation(Vec3::z() * turn * std::f32::consts::PI);
        let plan = |u: f32, z: f32, o: f32| (side * Point3::new(u - 0.5 * length, -out - o, z)).coords;
        let wall = Wall { length, floors, material, balconies: false, seed: random.bits() };
        facade::build(b, &plan, &wall, random);
    }
    let tiles = b.surface(ClassId::Building, 0, random.pick([Material::Brick, Material::Zinc]));
    let gable = b.surface(ClassId::Building, 0, material);
    let (top, ridge) = (floors as f32 * FLOOR_M, floors as f32 * FLOOR_M + 0.38 * depth);
    let eave = 0.45;
    for side in [-1.0, 1.0] {
        let low = top - 0.38 * depth * eave / y;
        let corners = [
            at(-x - eave, side * (y + eave), low),
            at(x + eave, side * (y + eave), low),
            at(x + eave, 0.0, ridge),
            at(-x - eave, 0.0, ridge),
        ];
        b.quad(corners, tiles);
        b.triangle([at(side * x, -y, top), at(side * x, y, top), at(side * x, 0.0, ridge)], gable);
    }
    let brick = b.surface(ClassId::Building, 0, Material::Brick);
    b.cuboid(pose, [0.2 * width, 0.3, top], [0.2 * width + 0.7, 0.9, ridge + 0.8], brick);
}
