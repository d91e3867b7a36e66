//! People in mid-step. The frame stands on the ground, x forward.

use crate::material::Material;
use crate::random::Random;
use crate::scene::builder::Builder;
use crate::trace::{Primitive, Shape, Vec3};
use messages::ClassId;

/// A person of 1.55 to 1.9 m. The model's surfaces are the builder's.
pub fn model(b: &mut Builder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let coat = random.pick([Material::RedCloth, Material::GrayCloth, Material::YellowCloth, Material::Denim]);
    let coat = b.surface(ClassId::Pedestrian, instance, coat);
    let legs = random.pick([Material::Denim, Material::GrayCloth]);
    let legs = b.surface(ClassId::Pedestrian, instance, legs);
    let skin = b.surface(ClassId::Pedestrian, instance, Material::Skin);
    let scale = random.range(1.55, 1.9) / 1.75;
    let step = random.range(0.1, 0.3);
    let first = b.primitives.len();
    let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z) * scale;
    for side in [-1.0_f32, 1.0] {
        let swing = side * step;
        b.add(Shape::cylinder(at(swing, side * 0.1, 0.0), at(0.0, side * 0.09, 0.86), 0.075 * scale), legs);
        b.add(Shape::cylinder(at(0.0, side * 0.2, 1.38), at(-0.7 * swing, side * 0.27, 0.82), 0.045 * scale), coat);
        b.add(Shape::Sphere { center: at(-0.7 * swing, side * 0.27, 0.79), radius: 0.05 * scale }, skin);
    }
    b.add(Shape::cylinder(at(0.0, 0.0, 0.82), at(0.02, 0.0, 1.42), 0.175 * scale), coat);
    b.add(Shape::Sphere { center: at(0.02, 0.0, 1.42), radius: 0.165 * scale }, coat);
    b.add(Shape::Sphere { center: at(0.05, 0.0, 1.63), radius: 0.115 * scale }, skin);
    b.take_since(first)
}
