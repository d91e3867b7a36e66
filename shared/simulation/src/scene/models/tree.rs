//! Trees: a trunk, branches, and clusters of leaves that rays pass in part.

use crate::material::Material;
use crate::random::Random;
use crate::scene::builder::Builder;
use crate::trace::{Shape, Vec3};
use messages::ClassId;
use nalgebra::{Isometry3, Point3};

/// A tree of 6 to 9 m with its foot at `pose`.
pub fn build(b: &mut Builder, pose: &Isometry3<f32>, random: &mut Random) {
    let bark = b.surface(ClassId::Vegetation, 0, Material::Bark);
    let leaves = b.surface(ClassId::Vegetation, 0, Material::Leaves);
    let at = |x: f32, y: f32, z: f32| (pose * Point3::new(x, y, z)).coords;
    let trunk = random.range(2.8, 3.6);
    let radius = random.range(0.11, 0.17);
    let lean = [random.range(-0.15, 0.15), random.range(-0.15, 0.15)];
    let fork = [lean[0], lean[1], trunk];
    b.add(Shape::cylinder(at(0.0, 0.0, -0.3), at(fork[0], fork[1], fork[2]), radius), bark);
    let crown = random.range(5.2, 6.2);
    let spread = random.range(1.5, 2.0);
    for i in 0..16 {
        // Clusters fill a ball: the golden angle spreads them around, the index from bottom to top.
        let share = (i as f32 + 0.5) / 16.0;
        let up = 2.0 * share - 1.0;
        let (angle, out) = (i as f32 * 2.399_963, (1.0 - up * up).sqrt() * spread * random.range(0.45, 1.0));
        let tip = Vec3::new(fork[0] + out * angle.cos(), fork[1] + out * angle.sin(), crown + up * spread);
        let center = at(tip.x, tip.y, tip.z);
        b.add(Shape::Porous { center, radius: random.range(0.55, 0.95), free_path: random.range(0.5, 0.9) }, leaves);
        if i % 3 == 0 {
            b.add(Shape::cylinder(at(fork[0], fork[1], fork[2] - 0.1), center, 0.35 * radius), bark);
        }
    }
}

/// A hedge of low bushes from `from` to `to` at their feet.
pub fn hedge(b: &mut Builder, from: &Vec3, to: &Vec3, random: &mut Random) {
    let leaves = b.surface(ClassId::Vegetation, 0, Material::Leaves);
    let n = ((to - from).norm() / 0.5).ceil().max(1.0) as usize;
    for i in 0..=n {
        let center = from.lerp(to, i as f32 / n as f32) + Vec3::new(0.0, 0.0, random.range(0.4, 0.6));
        b.add(Shape::Porous { center, radius: random.range(0.4, 0.55), free_path: 0.2 }, leaves);
    }
}
