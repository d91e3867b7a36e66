//! Lamp posts, signs, traffic lights, bins, benches, railings.

use crate::material::Material;
use crate::random::Random;
use crate::scene::builder::Builder;
use crate::trace::Shape;
use messages::ClassId;
use nalgebra::{Isometry3, Point3};

/// A post of 6.5 m whose arm reaches along the frame's y over the road.
pub fn lamp_post(b: &mut Builder, pose: &Isometry3<f32>) {
    let metal = b.surface(ClassId::Pole, 0, Material::DarkMetal);
    let lamp = b.surface(ClassId::Pole, 0, Material::Lamp);
    let at = |y: f32, z: f32| (pose * Point3::new(0.0, y, z)).coords;
    b.add(Shape::cylinder(at(0.0, -0.2), at(0.0, 0.9), 0.11), metal);
    b.add(Shape::cylinder(at(0.0, 0.9), at(0.0, 6.5), 0.065), metal);
    b.add(Shape::cylinder(at(0.0, 6.45), at(1.4, 6.7), 0.04), metal);
    b.cuboid(pose, [-0.13, 1.1, 6.6], [0.13, 1.7, 6.72], lamp);
}

/// A round or square plate of retroreflecting foil on a thin post; the plate faces the frame's -x.
pub fn sign(b: &mut Builder, pose: &Isometry3<f32>, random: &mut Random) {
    let post = b.surface(ClassId::Pole, 0, Material::PaintSilver);
    let back = b.surface(ClassId::TrafficSign, 0, Material::PaintSilver);
    let at = |x: f32, z: f32| (pose * Point3::new(x, 0.0, z)).coords;
    b.add(Shape::cylinder(at(0.0, -0.2), at(0.0, 2.75), 0.03), post);
    if random.chance(0.5) {
        let face = b.surface(ClassId::TrafficSign, 0, Material::SignRed);
        b.add(Shape::cylinder(at(-0.06, 2.4), at(-0.045, 2.4), 0.32), face);
        b.add(Shape::cylinder(at(-0.044, 2.4), at(-0.034, 2.4), 0.32), back);
    } else {
        let face = b.surface(ClassId::TrafficSign, 0, Material::SignBlue);
        b.cuboid(pose, [-0.06, -0.3, 2.1], [-0.045, 0.3, 2.7], face);
        b.cuboid(pose, [-0.044, -0.3, 2.1], [-0.034, 0.3, 2.7], back);
    }
}

/// A traffic light on a post, its lamps towards the frame's -x.
pub fn traffic_light(b: &mut Builder, pose: &Isometry3<f32>) {
    let post = b.surface(ClassId::Pole, 0, Material::DarkMetal);
    let head = b.surface(ClassId::TrafficLight, 0, Material::PaintBlack);
    let lamp = b.surface(ClassId::TrafficLight, 0, Material::SignRed);
    let at = |x: f32, z: f32| (pose * Point3::new(x, 0.0, z)).coords;
    b.add(Shape::cylinder(at(0.0, -0.2), at(0.0, 3.3), 0.06), post);
    b.cuboid(pose, [-0.24, -0.17, 2.35], [-0.07, 0.17, 3.3], head);
    b.add(Shape::Sphere { center: at(-0.22, 3.13), radius: 0.1 }, lamp);
}

/// A bin of plastic.
pub fn bin(b: &mut Builder, pose: &Isometry3<f32>) {
    let plastic = b.surface(ClassId::Dynamic, 0, Material::GreenPlastic);
    b.cuboid(pose, [-0.29, -0.35, 0.08], [0.29, 0.35, 1.0], plastic);
    b.cuboid(pose, [-0.32, -0.38, 1.0], [0.32, 0.4, 1.08], plastic);
}

/// A bench of planks; its back is on the frame's +y.
pub fn bench(b: &mut Builder, pose: &Isometry3<f32>) {
    let wood = b.surface(ClassId::Static, 0, Material::Wood);
    b.cuboid(pose, [-0.9, -0.25, 0.40], [0.9, 0.2, 0.46], wood);
    b.cuboid(pose, [-0.9, 0.2, 0.55], [0.9, 0.25, 0.9], wood);
    for x in [-0.75, 0.7] {
        b.cuboid(pose, [x, -0.22, -0.05], [x + 0.06, 0.24, 0.42], wood);
    }
}

/// A waist-high post of cast iron.
pub fn bollard(b: &mut Builder, pose: &Isometry3<f32>) {
    let iron = b.surface(ClassId::Static, 0, Material::DarkMetal);
    let at = |z: f32| (pose * Point3::new(0.0, 0.0, z)).coords;
    b.add(Shape::cylinder(at(-0.1), at(0.95), 0.05), iron);
    b.add(Shape::Sphere { center: at(1.0), radius: 0.075 }, iron);
}

/// A railing of upright bars between two feet, 1.1 m high, which most beams pass.
pub fn railing(b: &mut Builder, feet: &[nalgebra::Vector3<f32>]) {
    let metal = b.surface(ClassId::Fence, 0, Material::DarkMetal);
    let up = |z: f32| nalgebra::Vector3::new(0.0, 0.0, z);
    for pair in feet.windows(2) {
        for z in [0.15, 1.1] {
            b.add(Shape::cylinder(pair[0] + up(z), pair[1] + up(z), 0.022), metal);
        }
        let n = ((pair[1] - pair[0]).norm() / 0.12) as usize;
        for i in 0..n {
            let foot = pair[0].lerp(&pair[1], i as f32 / n as f32);
            b.add(Shape::cylinder(foot + up(0.15), foot + up(1.1), 0.009), metal);
        }
    }
}
