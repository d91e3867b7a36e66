//! Cars, vans, taxis, buses and trucks: a lofted body, glass, wheels in their arches, lamps and plates.
//!
//! The frame stands on the ground below the middle, x forward, m. All parts are class vehicles and bear one number.

use super::frame::{At, Frame};
use crate::material::Material;
use crate::random::Random;
use crate::scene::builder::{Builder, SurfaceId};
use crate::trace::Primitive;
use messages::ClassId::Vehicles;

/// The measures of a kind of car, m. Lists go from back to front.
struct Body {
    /// x, height of the shoulder under the windows, half width.
    outline: &'static [[f32; 3]],
    /// x of the rear window's foot and head, then of the windscreen's head and foot.
    cabin: [f32; 4],
    /// Height and half width of the roof.
    roof: [f32; 2],
    /// Between these x the sides have windows.
    glazed: [f32; 2],
    /// x of the window posts.
    posts: &'static [f32],
    axles: &'static [f32],
    wheel: f32,
    /// Height of the body over the ground.
    clearance: f32,
}

const HATCHBACK: Body = Body {
    outline: &[
        [-1.95, 0.80, 0.72],
        [-1.90, 0.93, 0.82],
        [-1.20, 0.97, 0.88],
        [0.85, 0.95, 0.88],
        [1.55, 0.86, 0.84],
        [1.90, 0.70, 0.74],
        [1.98, 0.55, 0.66],
    ],
    cabin: [-1.90, -1.55, 0.05, 1.00],
    roof: [1.47, 0.58],
    glazed: [-1.45, 0.85],
    posts: &[-0.62],
    axles: &[-1.22, 1.26],
    wheel: 0.31,
    clearance: 0.19,
};

const SALOON: Body = Body {
    outline: &[
        [-2.30, 0.72, 0.74],
        [-2.24, 0.94, 0.82],
        [-1.50, 1.00, 0.89],
        [0.80, 0.96, 0.90],
        [1.80, 0.84, 0.85],
        [2.22, 0.68, 0.74],
        [2.30, 0.54, 0.66],
    ],
    cabin: [-1.75, -1.15, 0.05, 0.95],
    roof: [1.43, 0.57],
    glazed: [-1.50, 0.80],
    posts: &[-0.50],
    axles: &[-1.38, 1.40],
    wheel: 0.32,
    clearance: 0.18,
};

const ESTATE: Body = Body {
    outline: SALOON.outline,
    cabin: [-2.22, -1.90, 0.05, 0.95],
    roof: [1.47, 0.60],
    glazed: [-1.95, 0.80],
    posts: &[-0.50, -1.35],
    ..SALOON
};

const SUV: Body = Body {
    outline: &[
        [-2.22, 0.95, 0.80],
        [-2.16, 1.08, 0.88],
        [-1.40, 1.12, 0.93],
        [0.75, 1.10, 0.94],
        [1.75, 1.02, 0.90],
        [2.18, 0.86, 0.80],
        [2.26, 0.66, 0.72],
    ],
    cabin: [-2.10, -1.80, 0.05, 0.85],
    roof: [1.70, 0.64],
    glazed: [-1.85, 0.72],
    posts: &[-0.50, -1.35],
    axles: &[-1.34, 1.38],
    wheel: 0.36,
    clearance: 0.26,
};

const CITY_CAR: Body = Body {
    outline: &[
        [-1.45, 0.85, 0.70],
        [-1.40, 0.98, 0.76],
        [-0.60, 1.02, 0.80],
        [0.75, 0.98, 0.80],
        [1.30, 0.86, 0.76],
        [1.47, 0.60, 0.64],
    ],
    cabin: [-1.38, -1.05, 0.20, 0.95],
    roof: [1.54, 0.58],
    glazed: [-1.00, 0.80],
    posts: &[-0.45],
    axles: &[-0.95, 0.98],
    wheel: 0.28,
    clearance: 0.18,
};

const VAN: Body = Body {
    outline: &[
        [-2.70, 1.20, 0.96],
        [-2.66, 1.25, 0.99],
        [1.30, 1.25, 1.00],
        [1.75, 1.15, 0.98],
        [2.45, 0.98, 0.92],
        [2.66, 0.62, 0.84],
    ],
    cabin: [-2.68, -2.60, 1.00, 1.85],
    roof: [2.35, 0.88],
    glazed: [0.72, 1.55],
    posts: &[],
    axles: &[-1.62, 1.70],
    wheel: 0.34,
    clearance: 0.24,
};

const MINIBUS: Body = Body { glazed: [-2.50, 1.55], posts: &[-1.75, -0.75, 0.30], roof: [2.05, 0.86], ..VAN };

const BUS: Body = Body {
    outline: &[[-6.0, 1.05, 1.22], [-5.9, 1.15, 1.26], [5.85, 1.05, 1.27], [6.0, 0.95, 1.22]],
    cabin: [-5.98, -5.85, 5.70, 5.98],
    roof: [2.95, 1.18],
    glazed: [-5.60, 5.60],
    posts: &[-4.30, -2.90, -1.50, -0.10, 1.30, 2.70, 4.10],
    axles: &[-3.10, 3.20],
    wheel: 0.48,
    clearance: 0.30,
};

const TRUCK_CAB: Body = Body {
    outline: &[[1.90, 1.60, 1.15], [1.95, 1.65, 1.20], [3.55, 1.60, 1.22], [3.70, 1.50, 1.15]],
    cabin: [1.92, 1.97, 3.30, 3.68],
    roof: [2.85, 1.10],
    glazed: [2.30, 3.50],
    posts: &[],
    axles: &[2.75],
    wheel: 0.48,
    clearance: 0.40,
};

/// A car of any kind, sometimes a taxi or a van, in a random color.
pub fn random_model(b: &mut Builder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    match random.index(24) {
        0 | 1 => van_model(b, instance, random),
        2 => taxi(b, instance, random),
        3 => minibus(b, instance, random),
        _ => car(b, instance, random),
    }
}

/// A hatchback, saloon, estate car, SUV or city car.
pub fn car(b: &mut Builder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let body = random.pick([&HATCHBACK, &HATCHBACK, &SALOON, &ESTATE, &SUV, &SUV, &CITY_CAR]);
    let paint = car_paint(random);
    let mut f = Frame::of_instance(b, instance);
    build(&mut f, body, paint);
    if random.chance(0.2) {
        roof_bars(&mut f, body);
    }
    f.model()
}

/// A saloon with a lit sign on its roof.
pub fn taxi(b: &mut Builder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paint = random.pick([Material::PaintBlack, Material::PaintBeige, Material::PaintYellow]);
    let mut f = Frame::of_instance(b, instance);
    build(&mut f, random.pick([&SALOON, &ESTATE]), paint);
    let lamp = f.surface(Vehicles, Material::Lamp);
    f.cuboid([-0.35, -0.24, SALOON.roof[0]], [-0.20, 0.24, SALOON.roof[0] + 0.17], lamp);
    f.model()
}

/// A panel van, one in three with a stripe.
pub fn van_model(b: &mut Builder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paint = random.pick([
        Material::PaintWhite,
        Material::PaintWhite,
        Material::PaintWhite,
        Material::PaintGray,
        Material::PaintYellow,
        Material::PaintBlue,
    ]);
    let mut f = Frame::of_instance(b, instance);
    build(&mut f, &VAN, paint);
    if random.chance(0.35) {
        let stripe = random.pick([Material::PaintRed, Material::PaintBlue, Material::PaintGreen]);
        let stripe = f.surface(Vehicles, stripe);
        f.cuboid([-2.3, -1.0, 0.95], [0.6, 1.0, 1.12], stripe);
    }
    f.model()
}

/// A van with windows all around.
pub fn minibus(b: &mut Builder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paint = car_paint(random);
    let mut f = Frame::of_instance(b, instance);
    build(&mut f, &MINIBUS, paint);
    f.model()
}

/// A city bus of 12 m; its doors are on the right.
pub fn bus(b: &mut Builder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paint = random.pick([Material::PaintGreen, Material::PaintWhite, Material::PaintRed, Material::PaintBlue]);
    let mut f = Frame::of_instance(b, instance);
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
pub fn truck(b: &mut Builder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let paint = random.pick([Material::PaintWhite, Material::PaintRed, Material::PaintBlue, Material::PaintGray]);
    let cargo = random.pick([Material::WhitePlastic, Material::WhitePlastic, Material::BlueCloth, Material::Steel]);
    let mut f = Frame::of_instance(b, instance);
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

fn car_paint(random: &mut Random) -> Material {
    random.pick([
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

/// One cross section of a body: from the sill over the widest place and the shoulder to the roof's edge, y and z.
struct Section {
    x: f32,
    ring: [[f32; 2]; 4],
}

impl Body {
    fn ends(&self) -> [f32; 2] {
        [self.outline[0][0], self.outline[self.outline.len() - 1][0]]
    }
    /// Shoulder height and half width at x.
    fn at(&self, x: f32) -> [f32; 2] {
        let after = self.outline.partition_point(|o| o[0] <= x).clamp(1, self.outline.len() - 1);
        let ([x0, z0, w0], [x1, z1, w1]) = (self.outline[after - 1], self.outline[after]);
        let share = ((x - x0) / (x1 - x0)).clamp(0.0, 1.0);
        [z0 + share * (z1 - z0), w0 + share * (w1 - w0)]
    }
    /// Height of the body's lower edge: the clearance, and round over the wheels.
    fn sill(&self, x: f32) -> f32 {
        let arch = self.wheel + 0.06;
        self.axles.iter().fold(self.clearance, |sill, axle| {
            let off2 = arch * arch - (x - axle) * (x - axle);
            if off2 > 0.0 { sill.max(self.wheel + off2.sqrt()) } else { sill }
        })
    }
    fn section(&self, x: f32) -> Section {
        let [shoulder, half] = self.at(x);
        let [rear, rear_head, front_head, front] = self.cabin;
        let share = ((x - rear) / (rear_head - rear)).min((front - x) / (front - front_head)).clamp(0.0, 1.0);
        let [roof, roof_half] = self.roof;
        let sill = self.sill(x).min(shoulder - 0.05);
        let base = half - 0.06;
        let top = [base + share * (roof_half - base), shoulder + share * (roof - shoulder)];
        let widest = sill + 0.55 * (shoulder - sill);
        Section { x, ring: [[half - 0.07, sill], [half, widest], [base, shoulder], top] }
    }
    /// x of all places where the body bends.
    fn stations(&self) -> Vec<f32> {
        let arch = self.wheel + 0.06;
        let arches =
            self.axles.iter().flat_map(|axle| [-1.0, -0.93, -0.55, 0.55, 0.93, 1.0].map(|share| axle + share * arch));
        let mut xs: Vec<f32> =
            self.outline.iter().map(|o| o[0]).chain(self.cabin).chain(self.glazed).chain(arches).collect();
        let [rear, front] = self.ends();
        xs.retain(|x| (rear..=front).contains(x));
        xs.sort_by(f32::total_cmp);
        xs.dedup_by(|a, b| (*a - *b).abs() < 0.012);
        xs
    }
}

fn build(f: &mut Frame<'_>, body: &Body, paint: Material) {
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

/// What is seen below and through the wheel arches.
fn underbody(f: &mut Frame<'_>, body: &Body, dark: SurfaceId) {
    let [rear, front] = body.ends();
    let lowest_shoulder = body.at(rear)[0].min(body.at(front)[0]);
    let half = body.at(0.5 * (rear + front))[1] - 0.28;
    f.cuboid([rear + 0.12, -half, body.clearance], [front - 0.12, half, lowest_shoulder - 0.05], dark);
    // Between the axles it closes the body to its sides.
    let arch = body.wheel + 0.08;
    let edges: Vec<f32> = body.axles.iter().flat_map(|axle| [axle - arch, axle + arch]).collect();
    for gap in std::iter::once(rear + 0.12).chain(edges).chain([front - 0.12]).collect::<Vec<_>>().chunks_exact(2) {
        if gap[1] - gap[0] > 0.05 {
            let half = body.at(gap[0])[1].min(body.at(gap[1])[1]) - 0.08;
            f.cuboid([gap[0], -half, body.clearance], [gap[1], half, body.clearance + 0.04], dark);
        }
    }
}

/// Posts beside the windows and edges of the screens, a cm outside the glass.
fn frames(f: &mut Frame<'_>, body: &Body, paint: SurfaceId) {
    let post = |f: &mut Frame<'_>, from: At, to: At, width: f32| f.beam(from, to, [width, 0.03], paint);
    let [rear, rear_head, front_head, front] = body.cabin;
    for side in [-1.0_f32, 1.0] {
        for (foot, head) in [(rear, rear_head), (front, front_head)] {
            let (low, high) = (body.section(foot), body.section(head));
            let place = |s: &Section| [s.x, side * s.ring[3][0], s.ring[3][1]];
            post(f, place(&low), place(&high), 0.06);
        }
        for x in body.posts {
            let section = body.section(*x);
            let place = |i: usize| [*x, side * (section.ring[i][0] + 0.014), section.ring[i][1]];
            let (low, high) = (place(2), place(3));
            f.quad([shifted(low, -0.05), shifted(low, 0.05), shifted(high, 0.05), shifted(high, -0.05)], paint);
        }
    }
}

const fn shifted([x, y, z]: At, along: f32) -> At {
    [x + along, y, z]
}

/// A tyre and a rim. `depth` is signed: inward from the outer face at `hub`.
fn wheel(f: &mut Frame<'_>, hub: At, depth: f32, radius: f32) {
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
    let (lamp_z, tail_z) = (nose - if is_tall { 0.3 } else { 0.02 }, tail_height - if is_tall { 0.25 } else { 0.02 });
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
            let (a, c) = (end - inward * from, end + inward * to);
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

fn roof_bars(f: &mut Frame<'_>, body: &Body) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::{Bvh, Ray, Vec3};

    #[test]
    fn bodies_have_the_size_of_cars_and_no_holes() {
        for (body, length, height) in [
            (&HATCHBACK, 3.93, 1.47),
            (&SALOON, 4.60, 1.43),
            (&ESTATE, 4.60, 1.47),
            (&SUV, 4.48, 1.70),
            (&CITY_CAR, 2.92, 1.54),
            (&VAN, 5.36, 2.35),
            (&BUS, 12.0, 2.95),
        ] {
            let mut builder = Builder::default();
            let mut f = Frame::of_instance(&mut builder, 7);
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
