//! Cars and vans: a lofted body, a glazed cabin and four wheels. The frame stands on the ground, x forward.

use crate::material::Material;
use crate::random::Random;
use crate::scene::builder::Builder;
use crate::trace::{Primitive, Shape, Vec3};
use messages::ClassId;

/// The measures of a kind of car, m.
struct Body {
    /// x, height and half width of the body's upper edge, from back to front.
    stations: &'static [[f32; 3]],
    /// x of the cabin's lower and upper edges from back to front, then the roof's height and half width.
    cabin: [f32; 6],
    /// x of the axles.
    axles: [f32; 2],
}

const SALOON: Body = Body {
    stations: &[
        [-2.12, 0.70, 0.72],
        [-2.02, 0.95, 0.82],
        [-1.30, 1.00, 0.87],
        [0.90, 0.96, 0.88],
        [1.85, 0.80, 0.82],
        [2.12, 0.55, 0.70],
    ],
    cabin: [-1.80, -1.05, 0.20, 1.00, 1.46, 0.62],
    axles: [-1.30, 1.32],
};

const HATCHBACK: Body = Body {
    stations: &[[-1.90, 0.75, 0.74], [-1.84, 0.98, 0.82], [-1.0, 1.02, 0.85], [0.95, 0.98, 0.85], [1.88, 0.70, 0.74]],
    cabin: [-1.86, -1.50, 0.25, 1.05, 1.54, 0.64],
    axles: [-1.18, 1.20],
};

const VAN: Body = Body {
    stations: &[[-2.60, 2.25, 0.92], [-2.55, 2.30, 0.95], [1.20, 2.30, 0.95], [1.75, 1.25, 0.95], [2.60, 0.95, 0.85]],
    cabin: [1.10, 1.12, 1.18, 1.80, 2.28, 0.90],
    axles: [-1.60, 1.65],
};

/// Height of the body above the ground, m.
const CLEARANCE_M: f32 = 0.26;
const WHEEL_M: f32 = 0.31;

/// A car or, one time in eight, a van in a random color. The model's surfaces are the builder's.
pub fn random_model(b: &mut Builder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let body = if random.chance(0.125) { &VAN } else { random.pick([&SALOON, &HATCHBACK]) };
    model(b, body, instance, random)
}

/// A van in a random color.
pub fn van_model(b: &mut Builder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    model(b, &VAN, instance, random)
}

fn model(b: &mut Builder, body: &Body, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paints = [
        Material::PaintWhite,
        Material::PaintSilver,
        Material::PaintSilver,
        Material::PaintBlack,
        Material::PaintRed,
        Material::PaintBlue,
    ];
    let paint = b.surface(ClassId::Vehicles, instance, random.pick(paints));
    let glass = b.surface(ClassId::Vehicles, instance, Material::CarGlass);
    let rubber = b.surface(ClassId::Vehicles, instance, Material::Rubber);
    let first = b.primitives.len();
    loft(b, body.stations, paint);
    cabin(b, body, paint, glass);
    for x in body.axles {
        for side in [-1.0_f32, 1.0] {
            let hub = |y: f32| Vec3::new(x, side * y, WHEEL_M);
            b.add(Shape::cylinder(hub(0.66), hub(0.88), WHEEL_M), rubber);
        }
    }
    b.take_since(first)
}

fn loft(b: &mut Builder, stations: &[[f32; 3]], paint: u32) {
    let low = |s: &[f32; 3], side: f32| Vec3::new(s[0], side * (s[2] - 0.06), CLEARANCE_M);
    let high = |s: &[f32; 3], side: f32| Vec3::new(s[0], side * s[2], s[1]);
    for pair in stations.windows(2) {
        let (a, c) = (&pair[0], &pair[1]);
        b.quad([high(a, -1.0), high(c, -1.0), high(c, 1.0), high(a, 1.0)], paint);
        b.quad([low(a, -1.0), low(c, -1.0), low(c, 1.0), low(a, 1.0)], paint);
        for side in [-1.0, 1.0] {
            b.quad([low(a, side), low(c, side), high(c, side), high(a, side)], paint);
        }
    }
    for end in [stations.first(), stations.last()].into_iter().flatten() {
        b.quad([low(end, -1.0), low(end, 1.0), high(end, 1.0), high(end, -1.0)], paint);
    }
}

fn cabin(b: &mut Builder, body: &Body, paint: u32, glass: u32) {
    let [back, roof_back, roof_front, front, top, roof_half] = body.cabin;
    let base_half = roof_half + 0.2;
    // The cabin stands a little inside the body, so that no gap shows.
    let foot = 0.9;
    let base = |x: f32, side: f32| Vec3::new(x, side * base_half, foot);
    let roof = |x: f32, side: f32| Vec3::new(x, side * roof_half, top);
    b.quad([roof(roof_back, -1.0), roof(roof_front, -1.0), roof(roof_front, 1.0), roof(roof_back, 1.0)], paint);
    b.quad([base(front, -1.0), base(front, 1.0), roof(roof_front, 1.0), roof(roof_front, -1.0)], glass);
    b.quad([base(back, -1.0), base(back, 1.0), roof(roof_back, 1.0), roof(roof_back, -1.0)], glass);
    for side in [-1.0, 1.0] {
        b.quad([base(back, side), base(front, side), roof(roof_front, side), roof(roof_back, side)], glass);
        // The door post, which the lidar sees where the panes let it pass.
        let middle = 0.5 * (roof_back + roof_front);
        let outside = |p: Vec3| p + Vec3::new(0.0, side * 0.01, 0.0);
        let post = [
            base(middle - 0.05, side),
            base(middle + 0.05, side),
            roof(middle + 0.05, side),
            roof(middle - 0.05, side),
        ];
        b.quad(post.map(outside), paint);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::{Bvh, Ray};

    #[test]
    fn a_car_has_the_size_of_a_car_and_no_hole() {
        let mut builder = Builder::default();
        let model = model(&mut builder, &SALOON, 7, &mut Random::new(1, 1));
        let tree = Bvh::new(model);
        let [low, high] = tree.bounds().expect("has primitives");
        let size = high - low;
        assert!(size.x > 4.0 && size.x < 4.5 && size.y > 1.7 && size.y < 1.9 && high.z > 1.4 && high.z < 1.6);
        for i in -20..=20 {
            let origin = Vec3::new(i as f32 * 0.1, 5.0, 0.5);
            let ray = Ray { origin, direction: -Vec3::y(), seed: 0 };
            let (range, primitive) = tree.nearest(&ray, 20.0).expect("the body is closed");
            assert!((range - 4.2).abs() < 0.2, "{range}");
            assert_eq!(builder.surfaces[primitive.surface as usize].instance, 7);
        }
    }
}
