//! Cars, vans, taxis, buses and trucks: a lofted body, glass, wheels in their arches, lamps and plates.
//!
//! The frame is on the ground below the middle, x forward, m. All parts have class vehicles and one instance.

mod bodywork;
mod outline;

use super::frame::Frame;
use crate::material::Material;
use crate::scene_builder::SceneBuilder;
use bodywork::{build, roof_bars, wheel};
use messages::ClassId::Vehicles;
use outline::{BUS, CITY_CAR, ESTATE, HATCHBACK, MINIBUS, SALOON, SUV, TRAM, TRUCK_CAB, VAN};
use random::Random;
use raytrace::Primitive;

/// A car of any kind, sometimes a taxi or a van, in a random color.
pub fn random_model(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    match random.index(24) {
        0 | 1 => van_model(b, instance, random),
        2 => taxi(b, instance, random),
        3 => minibus(b, instance, random),
        _ => car(b, instance, random),
    }
}

/// A hatchback, saloon, estate car, SUV or city car.
pub fn car(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let body = *random.pick(&[&HATCHBACK, &HATCHBACK, &SALOON, &ESTATE, &SUV, &SUV, &CITY_CAR]);
    let paint = car_paint(random);
    let mut f = Frame::for_instance(b, instance);
    build(&mut f, body, paint);
    if random.chance(0.2) {
        roof_bars(&mut f, body);
    }
    f.model()
}

/// A saloon with a lit sign on its roof.
pub fn taxi(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paint = *random.pick(&[Material::PaintBlack, Material::PaintBeige, Material::PaintYellow]);
    let mut f = Frame::for_instance(b, instance);
    let body = if random.index(2) == 0 { &SALOON } else { &ESTATE };
    build(&mut f, body, paint);
    let lamp = f.surface(Vehicles, Material::Lamp);
    f.cuboid([-0.35, -0.24, SALOON.roof[0]], [-0.20, 0.24, SALOON.roof[0] + 0.17], lamp);
    f.model()
}

/// A panel van, one in three with a stripe.
pub fn van_model(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paint = *random.pick(&[
        Material::PaintWhite,
        Material::PaintWhite,
        Material::PaintWhite,
        Material::PaintGray,
        Material::PaintYellow,
        Material::PaintBlue,
    ]);
    let mut f = Frame::for_instance(b, instance);
    build(&mut f, &VAN, paint);
    if random.chance(0.35) {
        let stripe = *random.pick(&[Material::PaintRed, Material::PaintBlue, Material::PaintGreen]);
        let stripe = f.surface(Vehicles, stripe);
        f.cuboid([-2.3, -1.0, 0.95], [0.6, 1.0, 1.12], stripe);
    }
    f.model()
}

/// A van with windows all around.
pub fn minibus(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paint = car_paint(random);
    let mut f = Frame::for_instance(b, instance);
    build(&mut f, &MINIBUS, paint);
    f.model()
}

/// A city bus of 12 m; its doors are on the right.
pub fn bus(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paint = *random.pick(&[Material::PaintGreen, Material::PaintWhite, Material::PaintRed, Material::PaintBlue]);
    let mut f = Frame::for_instance(b, instance);
    build(&mut f, &BUS, paint);
    let [dark, glass, amber, white] =
        [Material::BlackPlastic, Material::CarGlass, Material::LightAmber, Material::PaintWhite]
            .map(|material| f.surface(Vehicles, material));
    for x in [-0.6, 4.5] {
        f.cuboid([x - 0.65, -1.285, 0.36], [x + 0.65, -1.2, 2.55], dark);
        for leaf in [-0.31, 0.31] {
            f.cuboid([x + leaf - 0.26, -1.295, 0.5], [x + leaf + 0.26, -1.28, 2.45], glass);
        }
    }
    f.cuboid([5.75, -0.8, 2.62], [5.99, 0.8, 2.9], dark);
    f.cuboid([5.98, -0.65, 2.68], [6.0, 0.65, 2.84], amber);
    f.cuboid([-3.5, -0.8, 2.93], [2.0, 0.8, 3.15], white);
    f.model()
}

/// A truck of 7.4 m with a box body.
pub fn truck(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paint = *random.pick(&[Material::PaintWhite, Material::PaintRed, Material::PaintBlue, Material::PaintGray]);
    let cargo = *random.pick(&[Material::WhitePlastic, Material::WhitePlastic, Material::BlueCloth, Material::Steel]);
    let mut f = Frame::for_instance(b, instance);
    build(&mut f, &TRUCK_CAB, paint);
    let [cargo, dark, lamp, plate] = [cargo, Material::BlackPlastic, Material::TailLamp, Material::Licence]
        .map(|material| f.surface(Vehicles, material));
    f.cuboid([-3.7, -1.25, 1.05], [1.75, 1.25, 3.5], cargo);
    for y in [-0.45, 0.35] {
        f.cuboid([-3.6, y, 0.75], [2.2, y + 0.1, 1.05], dark);
    }
    for side in [-1.0_f32, 1.0] {
        wheel(&mut f, [-2.0, side * 1.18, 0.48], side * 0.5, 0.48);
        f.cuboid([-1.3, side * 1.1 - 0.03, 0.5], [1.6, side * 1.1 + 0.03, 0.95], dark);
        f.cuboid([-3.74, side * 1.0 - 0.2, 0.78], [-3.7, side * 1.0 + 0.2, 0.98], lamp);
    }
    f.cuboid([-3.72, -1.2, 0.5], [-3.62, 1.2, 0.62], dark);
    f.cuboid([-3.74, -0.26, 0.64], [-3.72, 0.26, 0.75], plate);
    f.model()
}

/// A tram of 24 m in three parts, its current collector up.
pub fn tram(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paint = *random.pick(&[Material::PaintWhite, Material::PaintGreen, Material::PaintSilver, Material::PaintRed]);
    let mut f = Frame::for_instance(b, instance);
    build(&mut f, &TRAM, paint);
    let [dark, glass, metal] =
        [Material::BlackPlastic, Material::CarGlass, Material::DarkMetal].map(|material| f.surface(Vehicles, material));
    // The bellows between the parts.
    for x in [-4.7, 4.7] {
        f.cuboid([x - 0.3, -1.225, 0.25], [x + 0.3, 1.225, 3.3], dark);
    }
    for side in [-1.0_f32, 1.0] {
        for x in [-8.3, 0.0, 8.3] {
            f.cuboid([x - 0.7, side * 1.215 - 0.02, 0.3], [x + 0.7, side * 1.215 + 0.02, 2.5], dark);
            f.cuboid([x - 0.6, side * 1.225 - 0.02, 0.4], [x + 0.6, side * 1.225 + 0.02, 2.4], glass);
        }
        for (foot, elbow) in [(0.6, -0.5), (0.4, -0.6)] {
            f.tube([foot, side * 0.5, 3.5], [elbow, side * 0.4, 4.0], 0.025, metal);
            f.tube([elbow, side * 0.4, 4.0], [0.5, side * 0.3, 4.5], 0.02, metal);
        }
    }
    f.tube([0.5, -0.8, 4.5], [0.5, 0.8, 4.5], 0.03, metal);
    for x in [-9.7, -8.1, -0.9, 0.9, 8.1, 9.7] {
        for side in [-1.0_f32, 1.0] {
            f.tube([x, side * 0.68, 0.3], [x, side * 0.8, 0.3], 0.3, metal);
        }
    }
    for x in [-9.0, 6.5] {
        f.cuboid([x, -0.8, 3.3], [x + 2.4, 0.8, 3.6], metal);
    }
    f.model()
}

/// A farm tractor with a cab, half of them with a trailer.
pub fn tractor(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paint = *random.pick(&[Material::PaintGreen, Material::PaintRed, Material::PaintBlue]);
    let mut f = Frame::for_instance(b, instance);
    let [paint, glass, dark, rim, lamp] =
        [paint, Material::CarGlass, Material::BlackPlastic, Material::PaintYellow, Material::Lamp]
            .map(|material| f.surface(Vehicles, material));
    let rubber = f.surface(Vehicles, Material::Rubber);
    for side in [-1.0_f32, 1.0] {
        for (x, radius, wide) in [(-0.9, 0.85, 0.5), (1.45, 0.55, 0.35)] {
            let [near, far] = [side * 0.65, side * (0.65 + wide)];
            f.tube([x, near, radius], [x, far, radius], radius, rubber);
            f.tube([x, far, radius], [x, far + side * 0.01, radius], 0.55 * radius, rim);
        }
        f.cuboid([-1.6, side * 0.9 - 0.27, 1.72], [-0.2, side * 0.9 + 0.27, 1.78], paint);
        f.tube([1.98, side * 0.3, 1.15], [2.01, side * 0.3, 1.15], 0.09, lamp);
    }
    f.cuboid([0.2, -0.38, 0.75], [2.0, 0.38, 1.45], paint);
    f.cuboid([-1.3, -0.55, 0.6], [0.4, 0.55, 1.3], dark);
    f.cuboid([-1.25, -0.72, 1.3], [0.15, 0.72, 2.45], glass);
    for [x, y] in [[-1.25, -0.72], [-1.25, 0.72], [0.15, -0.72], [0.15, 0.72]] {
        f.beam([x, y, 1.25], [x, y, 2.5], [0.08, 0.08], paint);
    }
    f.cuboid([-1.35, -0.8, 2.45], [0.25, 0.8, 2.6], paint);
    f.tube([1.1, 0.42, 1.3], [1.1, 0.42, 2.3], 0.04, dark);
    if random.chance(0.5) {
        f.beam([-1.3, 0.0, 0.6], [-2.4, 0.0, 0.8], [0.1, 0.1], dark);
        f.cuboid([-6.2, -1.1, 0.95], [-2.3, 1.1, 1.05], dark);
        for (low, high) in [
            ([-6.2, -1.1], [-2.3, -1.04]),
            ([-6.2, 1.04], [-2.3, 1.1]),
            ([-6.2, -1.04], [-6.14, 1.04]),
            ([-2.36, -1.04], [-2.3, 1.04]),
        ] {
            f.cuboid([low[0], low[1], 1.05], [high[0], high[1], 1.75], paint);
        }
        for x in [-5.2, -4.2] {
            for side in [-1.0_f32, 1.0] {
                f.tube([x, side * 0.8, 0.45], [x, side * 1.1, 0.45], 0.45, rubber);
            }
        }
    }
    f.model()
}

fn car_paint(random: &mut Random) -> Material {
    *random.pick(&[
        Material::PaintWhite,
        Material::PaintWhite,
        Material::PaintSilver,
        Material::PaintSilver,
        Material::PaintGray,
        Material::PaintGray,
        Material::PaintBlack,
        Material::PaintBlack,
        Material::PaintRed,
        Material::PaintBlue,
        Material::PaintGreen,
        Material::PaintBeige,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use raytrace::{Bvh, Ray, Vec3};

    #[test]
    fn vehicle_bodies_have_car_size_and_no_holes() {
        for (body, length, height) in [
            (&HATCHBACK, 3.93, 1.47),
            (&SALOON, 4.60, 1.43),
            (&ESTATE, 4.60, 1.47),
            (&SUV, 4.48, 1.70),
            (&CITY_CAR, 2.92, 1.54),
            (&VAN, 5.36, 2.35),
            (&BUS, 12.0, 2.95),
        ] {
            let mut builder = SceneBuilder::default();
            let mut f = Frame::for_instance(&mut builder, 7);
            build(&mut f, body, Material::PaintRed);
            let tree = Bvh::new(f.model());
            let [low, high] = tree.bounds().expect("has primitives");
            let size = high - low;
            assert!((size.x - length).abs() < 0.15 && (high.z - height).abs() < 0.03, "{size}");
            assert!(low.z.abs() < 1e-3, "wheels stand on the ground: {}", low.z);
            // Rays from the side, from above and from ahead all end on the near side of the body.
            let [rear, front] = body.ends();
            let n = 60;
            for i in 1..n {
                let share = i as f32 / n as f32;
                let x = rear + 0.06 + share * (front - rear - 0.12);
                let z = 0.5 * (body.sill(x).max(body.clearance) + body.at(x)[0]);
                let side = Ray { origin: Vec3::new(x, 5.0, z), direction: -Vec3::y(), seed: 0 };
                let (range, primitive) = tree.nearest(&side, 20.0).expect("side");
                assert!((range - 5.0 + body.at(x)[1]).abs() < 0.2, "{range} at {x}");
                assert_eq!(builder.surfaces[primitive.surface as usize].instance, 7);
                let above = Ray { origin: Vec3::new(x, 0.2, 9.0), direction: -Vec3::z(), seed: 0 };
                let (range, _) = tree.nearest(&above, 20.0).expect("top");
                let skin = body.section(x).ring[3][1];
                assert!((range - 9.0 + skin).abs() < 0.1, "{range} at {x}, skin at {skin}");
            }
        }
    }
}
