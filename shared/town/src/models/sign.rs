//! Traffic signs: plates of retroreflecting foil on thin posts. The plate faces the frame's -x; only the plate has class
//! sign.

use super::frame::{At, Frame};
use crate::material::Material;
use crate::scene_builder::{SceneBuilder, SurfaceId};
use messages::ClassId::{Pole, TrafficSign};
use nalgebra::Isometry3;
use random::Random;
use std::f32::consts::{FRAC_PI_8, TAU};

/// x of the plate faces, m; marks are slightly in front of them.
const FACE_X: f32 = -0.06;
/// Offset between layers of foil, m: above f32 rounding, below any visible thickness.
const LAYER_M: f32 = 0.003;

/// A post with one plate, sometimes a second one below.
pub fn sign(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let post = f.surface(Pole, Material::Steel);
    f.tube([0.0, 0.0, -0.3], [0.0, 0.0, 2.9], 0.03, post);
    let kinds = [no_entry, speed_limit, mandatory, stop, warning, give_way, parking, crossing];
    plate(&mut f, *random.pick(&kinds), 2.45, random);
    if random.chance(0.25) {
        let white = f.surface(TrafficSign, Material::SignWhite);
        let black = f.surface(TrafficSign, Material::BlackPlastic);
        board(&mut f, [0.6, 0.22], 1.92, white);
        f.cuboid([FACE_X - LAYER_M, -0.2, 1.88], [FACE_X, 0.2, 1.95], black);
    }
}

/// A board of 2 to 3 m with place names, on two posts.
pub fn direction_sign(b: &mut SceneBuilder, pose: &Isometry3<f32>, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let post = f.surface(Pole, Material::Steel);
    let face = *random.pick(&[Material::SignBlue, Material::SignGreen, Material::SignWhite]);
    let ink = if face == Material::SignWhite { Material::BlackPlastic } else { Material::SignWhite };
    let [face, ink] = [f.surface(TrafficSign, face), f.surface(TrafficSign, ink)];
    let half = random.range(1.0, 1.5);
    for y in [-0.6 * half, 0.6 * half] {
        f.tube([0.0, y, -0.3], [0.0, y, 3.3], 0.05, post);
    }
    board(&mut f, [2.0 * half, 1.2], 2.7, face);
    for line in 0..3 {
        words(&mut f, half, 2.35 + 0.33 * line as f32, ink, random);
    }
    f.triangle(
        [
            [FACE_X - LAYER_M, -0.75 * half, 2.85],
            [FACE_X - LAYER_M, -0.75 * half, 2.55],
            [FACE_X - LAYER_M, -0.93 * half, 2.7],
        ],
        ink,
    );
}

/// A line of words of different lengths on a board with half width `half`, with space for an arrow at its end.
fn words(f: &mut Frame<'_>, half: f32, z: f32, ink: SurfaceId, random: &mut Random) {
    let mut y = 0.85 * half;
    while y > -0.6 * half {
        let word = random.range(0.15, 0.4);
        f.cuboid([FACE_X - LAYER_M, y - word, z - 0.07], [FACE_X, y, z + 0.07], ink);
        y -= word + 0.1;
    }
}

/// A gantry over the lanes of one direction, `width_m` between its posts: a beam at 6 m with two or three boards.
pub fn gantry(b: &mut SceneBuilder, pose: &Isometry3<f32>, width_m: f32, random: &mut Random) {
    let mut f = Frame::new(b, pose);
    let steel = f.surface(Pole, Material::Steel);
    let half = 0.5 * width_m;
    for y in [-half, half] {
        f.cuboid([0.0, y - 0.2, -0.4], [0.4, y + 0.2, 6.6], steel);
    }
    for z in [5.7, 6.5] {
        f.cuboid([0.1, -half, z - 0.1], [0.3, half, z + 0.1], steel);
    }
    let n_braces = (width_m / 1.6) as usize;
    for i in 0..n_braces {
        let [from, to] = [i, i + 1].map(|i| -half + width_m * i as f32 / n_braces as f32);
        let [low, high] = if i % 2 == 0 { [5.7, 6.5] } else { [6.5, 5.7] };
        f.tube([0.2, from, low], [0.2, to, high], 0.04, steel);
    }
    let n_boards = 2 + random.index(2);
    for i in 0..n_boards {
        let y = -half + width_m * (i as f32 + 0.5) / n_boards as f32;
        let mut part = f.part([0.0, y, 0.0], 0.0);
        let [blue, white] = [Material::SignBlue, Material::SignWhite].map(|m| part.surface(TrafficSign, m));
        let [half_y, half_z] = [0.42 * width_m / n_boards as f32, random.range(0.9, 1.6)];
        board(&mut part, [2.0 * half_y, 2.0 * half_z], 6.2, blue);
        for line in 0..3 {
            words(&mut part, half_y, 6.2 + half_z * (0.55 * line as f32 - 0.55), white, random);
        }
    }
}

fn plate(f: &mut Frame<'_>, kind: fn(&mut Frame<'_>, f32, &mut Random), z: f32, random: &mut Random) {
    kind(f, z, random);
}

/// A disc of the given radius, `layer` sheets of foil in front of the plate face.
fn disc(f: &mut Frame<'_>, z: f32, radius: f32, layer: usize, surface: SurfaceId) {
    let front = FACE_X - LAYER_M * layer as f32;
    f.tube([front, 0.0, z], [FACE_X + 0.01, 0.0, z], radius, surface);
}

fn back(f: &mut Frame<'_>) -> SurfaceId {
    f.surface(TrafficSign, Material::Steel)
}

fn round(f: &mut Frame<'_>, z: f32, rim: Material) {
    let [rim, back] = [f.surface(TrafficSign, rim), back(f)];
    disc(f, z, 0.32, 0, rim);
    f.tube([FACE_X + 0.011, 0.0, z], [FACE_X + 0.02, 0.0, z], 0.32, back);
}

fn board(f: &mut Frame<'_>, [width, height]: [f32; 2], z: f32, surface: SurfaceId) {
    let back = back(f);
    let w = 0.5 * width;
    let h = 0.5 * height;
    f.cuboid([FACE_X, -w, z - h], [FACE_X + 0.012, w, z + h], surface);
    f.cuboid([FACE_X + 0.0125, -w, z - h], [FACE_X + 0.02, w, z + h], back);
}

fn no_entry(f: &mut Frame<'_>, z: f32, _: &mut Random) {
    round(f, z, Material::SignRed);
    let white = f.surface(TrafficSign, Material::SignWhite);
    f.cuboid([FACE_X - LAYER_M, -0.24, z - 0.055], [FACE_X, 0.24, z + 0.055], white);
}

fn speed_limit(f: &mut Frame<'_>, z: f32, random: &mut Random) {
    round(f, z, Material::SignRed);
    let [white, black] = [f.surface(TrafficSign, Material::SignWhite), f.surface(TrafficSign, Material::BlackPlastic)];
    disc(f, z, 0.24, 1, white);
    // "30" or "50" at a distance: a 0 next to a figure of bars.
    let front = FACE_X - 2.0 * LAYER_M;
    f.tube([front, -0.1, z], [FACE_X, -0.1, z], 0.085, black);
    f.tube([front - LAYER_M, -0.1, z], [FACE_X, -0.1, z], 0.05, white);
    for up in [-0.085, 0.0, 0.085] {
        f.cuboid([front, 0.02, z + up - 0.017], [FACE_X, 0.15, z + up + 0.017], black);
    }
    let upper = if random.chance(0.5) { 0.02 } else { 0.12 };
    f.cuboid([front, upper, z], [FACE_X, upper + 0.035, z + 0.085], black);
    f.cuboid([front, 0.02, z - 0.085], [FACE_X, 0.055, z], black);
}

fn mandatory(f: &mut Frame<'_>, z: f32, random: &mut Random) {
    round(f, z, Material::SignBlue);
    let white = f.surface(TrafficSign, Material::SignWhite);
    let front = FACE_X - LAYER_M;
    f.cuboid([front, -0.03, z - 0.2], [FACE_X, 0.03, z + 0.1], white);
    let side = *random.pick(&[-0.12, 0.0, 0.12]);
    f.triangle([[front, side - 0.11, z + 0.06], [front, side + 0.11, z + 0.06], [front, side, z + 0.22]], white);
}

fn stop(f: &mut Frame<'_>, z: f32, _: &mut Random) {
    let [red, white, back] =
        [f.surface(TrafficSign, Material::SignRed), f.surface(TrafficSign, Material::SignWhite), back(f)];
    polygon(f, FACE_X, z, 0.36, 8, FRAC_PI_8, red);
    polygon(f, FACE_X + 0.01, z, 0.36, 8, FRAC_PI_8, back);
    for y in [-0.2, -0.07, 0.06, 0.19] {
        f.cuboid([FACE_X - LAYER_M, y - 0.045, z - 0.08], [FACE_X, y + 0.045, z + 0.08], white);
    }
}

fn warning(f: &mut Frame<'_>, z: f32, _: &mut Random) {
    triangle_plate(f, z, 0.0);
    let black = f.surface(TrafficSign, Material::BlackPlastic);
    let front = FACE_X - 2.0 * LAYER_M;
    f.cuboid([front, -0.03, z - 0.06], [FACE_X, 0.03, z + 0.14], black);
    f.tube([front, 0.0, z - 0.12], [FACE_X, 0.0, z - 0.12], 0.03, black);
}

fn give_way(f: &mut Frame<'_>, z: f32, _: &mut Random) {
    triangle_plate(f, z, 0.5 * TAU);
}

/// A red triangle with a white middle, rotated from tip-up by `turn`.
fn triangle_plate(f: &mut Frame<'_>, z: f32, turn: f32) {
    let [red, white, back] =
        [f.surface(TrafficSign, Material::SignRed), f.surface(TrafficSign, Material::SignWhite), back(f)];
    polygon(f, FACE_X, z, 0.42, 3, turn, red);
    polygon(f, FACE_X - LAYER_M, z, 0.27, 3, turn, white);
    polygon(f, FACE_X + 0.01, z, 0.42, 3, turn, back);
}

fn parking(f: &mut Frame<'_>, z: f32, _: &mut Random) {
    let [blue, white] = [f.surface(TrafficSign, Material::SignBlue), f.surface(TrafficSign, Material::SignWhite)];
    board(f, [0.6, 0.6], z, blue);
    let front = FACE_X - LAYER_M;
    f.cuboid([front, 0.06, z - 0.2], [FACE_X, 0.12, z + 0.2], white);
    for up in [0.0, 0.15] {
        f.cuboid([front, -0.1, z + up], [FACE_X, 0.07, z + up + 0.05], white);
    }
    f.cuboid([front, -0.14, z], [FACE_X, -0.08, z + 0.2], white);
}

fn crossing(f: &mut Frame<'_>, z: f32, _: &mut Random) {
    let [blue, white, black] = [Material::SignBlue, Material::SignWhite, Material::BlackPlastic]
        .map(|material| f.surface(TrafficSign, material));
    board(f, [0.65, 0.65], z, blue);
    polygon(f, FACE_X - LAYER_M, z - 0.02, 0.3, 3, 0.0, white);
    f.cuboid([FACE_X - 2.0 * LAYER_M, -0.03, z - 0.12], [FACE_X, 0.03, z + 0.06], black);
    f.tube([FACE_X - 2.0 * LAYER_M, 0.0, z + 0.1], [FACE_X, 0.0, z + 0.1], 0.03, black);
}

/// A regular polygon that faces -x; its first corner points up, turned by `turn`.
fn polygon(f: &mut Frame<'_>, x: f32, z: f32, radius: f32, n: usize, turn: f32, surface: SurfaceId) {
    let corner = |i: usize| -> At {
        let angle = turn + TAU * i as f32 / n as f32;
        [x, radius * angle.sin(), z + radius * angle.cos()]
    };
    for i in 1..n - 1 {
        f.triangle([corner(0), corner(i), corner(i + 1)], surface);
    }
}
