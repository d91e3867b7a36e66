//! Bicycles, scooters and motorcycles, parked or ridden.
//!
//! The frame is on the ground below the middle, x forward, m. The machine is class vehicles and its rider class
//! pedestrian; they move together and have the same instance.

use super::frame::{At, Frame};
use super::person::{PersonAppearance, Posture, figure};
use crate::material::Material;
use crate::scene_builder::{SceneBuilder, SurfaceId};
use messages::ClassId::Vehicles;
use random::Random;
use raytrace::Primitive;
use std::f32::consts::TAU;

/// A bicycle on its stand.
pub fn bicycle(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let mut f = Frame::for_instance(b, instance);
    draw_bicycle(&mut f, random, 0.1);
    let metal = f.surface(Vehicles, Material::Steel);
    f.tube([-0.1, 0.0, 0.3], [-0.12, 0.16, 0.0], 0.012, metal);
    f.model()
}

/// A cyclist at a phase of the pedals, 0 to 1.
pub fn cyclist(b: &mut SceneBuilder, instance: u16, phase: f32, random: &mut Random) -> Vec<Primitive> {
    let mut f = Frame::for_instance(b, instance);
    draw_bicycle(&mut f, random, phase);
    let (sin, cos) = (TAU * phase).sin_cos();
    let posture = Posture {
        hips_m: Some(0.98),
        lean: 0.45,
        thighs: [1.05 + 0.3 * sin, 1.05 - 0.3 * sin],
        knees: [1.15 + 0.35 * cos, 1.15 - 0.35 * cos],
        shoulders: [1.0; 2],
        elbows: [0.35; 2],
        straddle: 0.0,
    };
    ride(&mut f, [-0.22, 0.0, 0.0], &posture, random);
    f.model()
}

/// A motor scooter on its stand.
pub fn scooter(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let mut f = Frame::for_instance(b, instance);
    draw_scooter(&mut f, random);
    f.model()
}

/// A motor scooter with its rider.
pub fn scooter_rider(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let mut f = Frame::for_instance(b, instance);
    draw_scooter(&mut f, random);
    let posture = Posture {
        hips_m: Some(0.86),
        lean: 0.05,
        thighs: [1.3; 2],
        knees: [1.25; 2],
        shoulders: [0.85; 2],
        elbows: [0.5; 2],
        straddle: 0.12,
    };
    ride(&mut f, [-0.3, 0.0, 0.0], &posture, random);
    f.model()
}

/// A motorcycle on its stand.
pub fn motorcycle(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let mut f = Frame::for_instance(b, instance);
    draw_motorcycle(&mut f, random);
    f.model()
}

/// A motorcycle with its rider.
pub fn motorcyclist(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let mut f = Frame::for_instance(b, instance);
    draw_motorcycle(&mut f, random);
    let posture = Posture {
        hips_m: Some(0.90),
        lean: 0.35,
        thighs: [1.15; 2],
        knees: [1.5; 2],
        shoulders: [1.0; 2],
        elbows: [0.45; 2],
        straddle: 0.32,
    };
    ride(&mut f, [-0.32, 0.0, 0.0], &posture, random);
    f.model()
}

/// An adult rider in the saddle above `at`.
fn ride(f: &mut Frame<'_>, at: At, posture: &Posture, random: &mut Random) {
    let appearance = PersonAppearance::random(random).without_luggage(random.range(1.6, 1.88));
    figure(&mut f.part(at, 0.0), &appearance, posture);
}

fn draw_bicycle(f: &mut Frame<'_>, random: &mut Random, pedals: f32) {
    let paint = *random.pick(&[
        Material::PaintBlack,
        Material::PaintRed,
        Material::PaintBlue,
        Material::PaintGreen,
        Material::Steel,
    ]);
    let [frame, metal, rubber, lamp, tail] =
        [paint, Material::Steel, Material::Rubber, Material::Lamp, Material::TailLamp].map(|m| f.surface(Vehicles, m));
    let rear = [-0.52, 0.0, 0.34];
    let front = [0.53, 0.0, 0.34];
    for hub in [rear, front] {
        spoked_wheel(f, hub, 0.33, [rubber, metal]);
    }
    let crank = [-0.08, 0.0, 0.29];
    let seat = [-0.25, 0.0, 0.8];
    let head_low = [0.4, 0.0, 0.65];
    let head_high = [0.35, 0.0, 0.85];
    for (from, to) in
        [(crank, seat), (crank, head_low), (seat, head_high), (rear, crank), (rear, seat), (head_low, head_high)]
    {
        f.tube(from, to, 0.016, frame);
    }
    f.tube(front, head_low, 0.014, frame);
    f.tube(seat, [-0.28, 0.0, 0.93], 0.013, metal);
    f.cuboid([-0.42, -0.07, 0.92], [-0.16, 0.07, 0.97], rubber);
    f.tube(head_high, [0.34, 0.0, 1.0], 0.013, metal);
    f.tube([0.34, -0.28, 1.02], [0.34, 0.28, 1.02], 0.013, metal);
    for side in [-1.0_f32, 1.0] {
        f.tube([0.34, side * 0.28, 1.02], [0.22, side * 0.3, 1.0], 0.016, rubber);
        let (s, c) = (TAU * pedals).sin_cos();
        let pedal = [-0.08 + side * 0.17 * c, side * 0.1, 0.29 - side * 0.17 * s];
        f.tube([-0.08, side * 0.06, 0.29], pedal, 0.01, metal);
        f.cuboid(
            [pedal[0] - 0.05, pedal[1] - 0.04, pedal[2] - 0.01],
            [pedal[0] + 0.05, pedal[1] + 0.04, pedal[2] + 0.01],
            rubber,
        );
    }
    f.tube([-0.08, -0.05, 0.29], [-0.08, -0.04, 0.29], 0.09, metal);
    f.cuboid([0.4, -0.03, 0.86], [0.46, 0.03, 0.92], lamp);
    f.cuboid([-0.5, -0.03, 0.72], [-0.47, 0.03, 0.78], tail);
    if random.chance(0.4) {
        f.mesh([[0.42, -0.18, 0.78], [0.42, 0.18, 0.78], [0.72, -0.18, 0.78]], 0.5, metal);
        f.mesh([[0.72, -0.18, 0.78], [0.72, 0.18, 0.78], [0.72, -0.18, 1.0]], 0.5, metal);
    }
}

/// A rim of short tubes with crossed spokes; rays pass between them.
fn spoked_wheel(f: &mut Frame<'_>, hub: At, radius: f32, [rubber, metal]: [SurfaceId; 2]) {
    const PIECES: usize = 14;
    let at = |i: usize| {
        let (s, c) = (TAU * i as f32 / PIECES as f32).sin_cos();
        [hub[0] + radius * c, hub[1], hub[2] + radius * s]
    };
    for i in 0..PIECES {
        f.tube(at(i), at(i + 1), 0.017, rubber);
        if i % 2 == 0 {
            f.tube(hub, at(i), 0.003, metal);
        }
    }
    f.tube([hub[0], -0.05, hub[2]], [hub[0], 0.05, hub[2]], 0.03, metal);
}

fn draw_scooter(f: &mut Frame<'_>, random: &mut Random) {
    let paint = *random.pick(&[
        Material::PaintRed,
        Material::PaintWhite,
        Material::PaintBeige,
        Material::PaintBlue,
        Material::PaintBlack,
    ]);
    let [paint, dark, rubber, lamp, tail, plate] =
        [paint, Material::BlackPlastic, Material::Rubber, Material::Lamp, Material::TailLamp, Material::Licence]
            .map(|m| f.surface(Vehicles, m));
    for x in [-0.62, 0.62] {
        f.tube([x, -0.055, 0.23], [x, 0.055, 0.23], 0.23, rubber);
    }
    f.beam([-0.85, 0.0, 0.62], [-0.25, 0.0, 0.55], [0.3, 0.3], paint);
    f.cuboid([-0.8, -0.14, 0.74], [-0.15, 0.14, 0.82], dark);
    f.cuboid([-0.35, -0.16, 0.24], [0.35, 0.16, 0.3], paint);
    f.beam([0.3, 0.0, 0.3], [0.48, 0.0, 0.85], [0.34, 0.08], paint);
    f.tube([0.62, 0.0, 0.3], [0.46, 0.0, 0.95], 0.03, dark);
    f.beam([0.62, 0.0, 0.48], [0.85, 0.0, 0.36], [0.14, 0.04], paint);
    f.ball([0.48, 0.0, 0.98], 0.12, paint);
    f.tube([0.58, 0.0, 0.98], [0.61, 0.0, 0.98], 0.07, lamp);
    f.tube([0.44, -0.33, 1.04], [0.44, 0.33, 1.04], 0.017, dark);
    for side in [-1.0_f32, 1.0] {
        f.tube([0.46, side * 0.25, 1.04], [0.45, side * 0.3, 1.2], 0.008, dark);
        f.ball([0.45, side * 0.31, 1.23], 0.05, dark);
    }
    f.cuboid([-0.88, -0.1, 0.6], [-0.84, 0.1, 0.68], tail);
    f.cuboid([-0.92, -0.09, 0.4], [-0.9, 0.09, 0.53], plate);
    f.tube([-0.1, -0.15, 0.25], [-0.1, -0.2, 0.0], 0.015, dark);
    f.tube([-0.1, 0.15, 0.25], [-0.1, 0.2, 0.0], 0.015, dark);
    if random.chance(0.4) {
        f.cuboid([-0.98, -0.2, 0.84], [-0.6, 0.2, 1.2], dark);
    }
}

fn draw_motorcycle(f: &mut Frame<'_>, random: &mut Random) {
    let paint = *random.pick(&[Material::PaintBlack, Material::PaintRed, Material::PaintBlue, Material::PaintSilver]);
    let [paint, dark, metal, rubber, lamp, tail] =
        [paint, Material::BlackPlastic, Material::Steel, Material::Rubber, Material::Lamp, Material::TailLamp]
            .map(|m| f.surface(Vehicles, m));
    for (x, half) in [(-0.7, 0.08), (0.72, 0.06)] {
        f.tube([x, -half, 0.32], [x, half, 0.32], 0.32, rubber);
        f.tube([x, -half - 0.005, 0.32], [x, half + 0.005, 0.32], 0.19, metal);
    }
    f.cuboid([-0.25, -0.17, 0.25], [0.3, 0.17, 0.62], metal);
    f.beam([-0.15, 0.0, 0.78], [0.32, 0.0, 0.88], [0.3, 0.24], paint);
    f.ball([0.3, 0.0, 0.86], 0.15, paint);
    f.beam([-0.85, 0.0, 0.84], [-0.1, 0.0, 0.76], [0.26, 0.1], dark);
    f.beam([-0.7, 0.0, 0.35], [-0.1, 0.0, 0.42], [0.1, 0.08], dark);
    for side in [-1.0_f32, 1.0] {
        f.tube([0.72, side * 0.1, 0.32], [0.5, side * 0.1, 0.98], 0.025, metal);
        f.tube([-0.2, side * 0.2, 0.3], [-0.85, side * 0.2, 0.42], 0.045, metal);
        f.tube([0.46, 0.0, 1.02], [0.36, side * 0.36, 1.06], 0.017, dark);
        f.ball([0.42, side * 0.34, 1.2], 0.055, dark);
    }
    f.tube([0.5, 0.0, 0.95], [0.68, 0.0, 0.93], 0.1, dark);
    f.tube([0.68, 0.0, 0.93], [0.69, 0.0, 0.93], 0.085, lamp);
    f.cuboid([-0.92, -0.08, 0.78], [-0.86, 0.08, 0.84], tail);
    let plate = f.surface(Vehicles, Material::Licence);
    f.cuboid([-0.99, -0.1, 0.52], [-0.97, 0.1, 0.65], plate);
    f.beam([-0.85, 0.0, 0.78], [-0.98, 0.0, 0.58], [0.14, 0.02], dark);
    f.tube([0.0, 0.12, 0.3], [0.0, 0.3, 0.0], 0.015, metal);
}
