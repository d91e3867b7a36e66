//! A body from its outline: skin, glass, window frames, wheels in their arches, lamps, plates and handles.

use super::outline::{Body, Section};
use crate::material::Material;
use crate::models::frame::{At, Frame};
use crate::scene_builder::SurfaceId;
use messages::ClassId::Vehicles;

pub fn build(f: &mut Frame<'_>, body: &Body, paint: Material) {
    let [paint, glass, dark] =
        [paint, Material::CarGlass, Material::BlackPlastic].map(|material| f.surface(Vehicles, material));
    let sections: Vec<Section> = body.stations().into_iter().map(|x| body.section(x)).collect();
    for pair in sections.windows(2) {
        shell(f, body, [&pair[0], &pair[1]], [paint, glass]);
    }
    for end in [&sections[0], &sections[sections.len() - 1]] {
        let corner = |side: f32, i: usize| [end.x, side * end.ring[i][0], end.ring[i][1]];
        for i in 0..2 {
            f.quad([corner(-1.0, i), corner(1.0, i), corner(1.0, i + 1), corner(-1.0, i + 1)], paint);
        }
    }
    underbody(f, body, dark);
    frames(f, body, paint);
    for axle in body.axles {
        let [_, half] = body.at(*axle);
        for side in [-1.0_f32, 1.0] {
            wheel(f, [*axle, side * (half - 0.03), body.wheel], side * 0.22, body.wheel);
        }
    }
    fittings(f, body, dark);
}

/// The skin between two sections: sides, windows, hood, screens and roof.
fn shell(f: &mut Frame<'_>, body: &Body, [a, b]: [&Section; 2], [paint, glass]: [SurfaceId; 2]) {
    let middle = 0.5 * (a.x + b.x);
    let corner = |section: &Section, side: f32, i: usize| [section.x, side * section.ring[i][0], section.ring[i][1]];
    let [rear, rear_head, front_head, front] = body.cabin;
    for side in [-1.0, 1.0] {
        for i in 0..3 {
            let window = i == 2 && (body.glazed[0]..body.glazed[1]).contains(&middle);
            let surface = if window { glass } else { paint };
            f.quad([corner(a, side, i), corner(b, side, i), corner(b, side, i + 1), corner(a, side, i + 1)], surface);
        }
    }
    let screen = (rear..rear_head).contains(&middle) || (front_head..front).contains(&middle);
    // Vans and trucks have no window in the back.
    let blind = middle < 0.0 && body.glazed[0] > 0.0 || body.outline[0][0] > 0.0 && middle < front_head;
    let surface = if screen && !blind { glass } else { paint };
    f.quad([corner(a, -1.0, 3), corner(b, -1.0, 3), corner(b, 1.0, 3), corner(a, 1.0, 3)], surface);
}

/// The visible parts below the body and in the wheel arches.
fn underbody(f: &mut Frame<'_>, body: &Body, dark: SurfaceId) {
    let [rear, front] = body.ends();
    let lowest_shoulder = body.at(rear)[0].min(body.at(front)[0]);
    let half = body.at(0.5 * (rear + front))[1] - 0.28;
    f.cuboid([rear + 0.12, -half, body.clearance], [front - 0.12, half, lowest_shoulder - 0.05], dark);
    // Between the axles it closes the body up to its sides.
    let arch = body.wheel + 0.08;
    let edges: Vec<f32> = body.axles.iter().flat_map(|axle| [axle - arch, axle + arch]).collect();
    for gap in std::iter::once(rear + 0.12).chain(edges).chain([front - 0.12]).collect::<Vec<_>>().chunks_exact(2) {
        if gap[1] - gap[0] > 0.05 {
            let half = body.at(gap[0])[1].min(body.at(gap[1])[1]) - 0.08;
            f.cuboid([gap[0], -half, body.clearance], [gap[1], half, body.clearance + 0.04], dark);
        }
    }
}

/// Window posts and edges of the screens, a cm outside the glass.
fn frames(f: &mut Frame<'_>, body: &Body, paint: SurfaceId) {
    let post = |f: &mut Frame<'_>, from: At, to: At, width: f32| f.beam(from, to, [width, 0.03], paint);
    let [rear, rear_head, front_head, front] = body.cabin;
    for side in [-1.0_f32, 1.0] {
        for (foot, head) in [(rear, rear_head), (front, front_head)] {
            let low = body.section(foot);
            let high = body.section(head);
            let place = |s: &Section| [s.x, side * s.ring[3][0], s.ring[3][1]];
            post(f, place(&low), place(&high), 0.06);
        }
        for x in body.posts {
            let section = body.section(*x);
            let place = |i: usize| [*x, side * (section.ring[i][0] + 0.014), section.ring[i][1]];
            let low = place(2);
            let high = place(3);
            f.quad([shifted(low, -0.05), shifted(low, 0.05), shifted(high, 0.05), shifted(high, -0.05)], paint);
        }
    }
}

const fn shifted([x, y, z]: At, along: f32) -> At {
    [x + along, y, z]
}

/// A tyre and a rim. `depth` is signed: inward from the outer face at `hub`.
pub fn wheel(f: &mut Frame<'_>, hub: At, depth: f32, radius: f32) {
    let [rubber, rim, dark] =
        [Material::Rubber, Material::PaintSilver, Material::BlackPlastic].map(|material| f.surface(Vehicles, material));
    let [x, y, z] = hub;
    let out = depth.signum() * 0.006;
    f.tube([x, y - depth, z], [x, y, z], radius, rubber);
    f.tube([x, y, z], [x, y + out, z], 0.66 * radius, rim);
    for i in 0..5 {
        let angle = std::f32::consts::TAU * i as f32 / 5.0;
        let (s, c) = angle.sin_cos();
        let at = [x + 0.4 * radius * c, y + out, z + 0.4 * radius * s];
        f.tube(at, [at[0], y + 1.5 * out, at[2]], 0.13 * radius, dark);
    }
}

/// Lamps, plates, bumpers, mirrors, handles.
fn fittings(f: &mut Frame<'_>, body: &Body, dark: SurfaceId) {
    let [lamp, tail, plate] =
        [Material::Lamp, Material::TailLamp, Material::Licence].map(|material| f.surface(Vehicles, material));
    let [rear, front] = body.ends();
    let is_tall = body.roof[0] > 1.9;
    let [nose, nose_half] = body.at(front);
    let [tail_height, tail_half] = body.at(rear);
    let lamp_z = nose - if is_tall { 0.3 } else { 0.02 };
    let tail_z = tail_height - if is_tall { 0.25 } else { 0.02 };
    for side in [-1.0_f32, 1.0] {
        let lamp_y = side * (nose_half - 0.16);
        f.cuboid([front - 0.14, lamp_y - 0.14, lamp_z - 0.07], [front + 0.012, lamp_y + 0.14, lamp_z + 0.06], lamp);
        let tail_y = side * (tail_half - 0.1);
        f.cuboid([rear - 0.012, tail_y - 0.1, tail_z - 0.1], [rear + 0.1, tail_y + 0.1, tail_z + 0.09], tail);
        let x = body.cabin[3] - 0.25;
        let [shoulder, half] = body.at(x);
        let y = side * (half + 0.07);
        f.cuboid([x - 0.05, y - 0.09, shoulder + 0.02], [x + 0.06, y + 0.09, shoulder + 0.18], dark);
        for x in body.posts.iter().take(2) {
            let [shoulder, half] = body.at(x + 0.12);
            f.cuboid(
                [x + 0.06, side * (half - 0.02) - 0.02, shoulder - 0.14],
                [x + 0.22, side * (half - 0.02) + 0.02, shoulder - 0.11],
                dark,
            );
        }
    }
    for (end, inward, half) in [(front, -1.0_f32, nose_half), (rear, 1.0, tail_half)] {
        let span = |from: f32, to: f32| {
            let a = end - inward * from;
            let c = end + inward * to;
            [a.min(c), a.max(c)]
        };
        let low = body.clearance + 0.03;
        let [x0, x1] = span(0.03, 0.08);
        f.cuboid([x0, -half - 0.02, low], [x1, half + 0.02, low + 0.12], dark);
        let [x0, x1] = span(0.045, 0.0);
        f.cuboid([x0, -0.26, low + 0.13], [x1, 0.26, low + 0.24], plate);
    }
    f.cuboid([front - 0.02, -0.5 * nose_half, lamp_z - 0.06], [front + 0.008, 0.5 * nose_half, lamp_z + 0.03], dark);
}

pub fn roof_bars(f: &mut Frame<'_>, body: &Body) {
    let metal = f.surface(Vehicles, Material::Steel);
    let [roof, half] = body.roof;
    for side in [-1.0_f32, 1.0] {
        let y = side * (half - 0.05);
        f.tube([body.cabin[1] + 0.1, y, roof + 0.05], [body.cabin[2] - 0.15, y, roof + 0.05], 0.02, metal);
        for x in [body.cabin[1] + 0.2, body.cabin[2] - 0.25] {
            f.tube([x, y, roof - 0.02], [x, y, roof + 0.05], 0.02, metal);
        }
    }
}
