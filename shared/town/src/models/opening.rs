//! Windows, doors, shop fronts and gateways in a facade.

use super::style::Style;
use super::wall::{FacadeSurfaces, WallFrame, block};
use crate::material::Material;
use crate::scene_builder::{SceneBuilder, SurfaceId};
use messages::ClassId::Building;
use random::Random;
use raytrace::{Shape, Vec3};

/// Kind of an opening.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OpeningKind {
    /// With panes, a sill and perhaps shutters.
    Window,
    /// With a leaf and a step.
    Door,
    /// A large pane under a board, perhaps an awning.
    Shop,
    /// Open: a passage.
    Gate,
}

/// The edges of an opening along the wall and above the foot of the house, m.
#[derive(Clone, Copy, Debug)]
pub struct Opening {
    /// Left and right edge.
    pub u: [f32; 2],
    /// Lower and upper edge.
    pub z: [f32; 2],
    kind: OpeningKind,
}

/// Appearance of the shops of a house.
pub struct Shop {
    board: Material,
    awning: Option<Material>,
}

impl Shop {
    /// A random appearance; four in ten shops have awnings.
    pub fn random(random: &mut Random) -> Self {
        let cloth = [Material::RedCloth, Material::GreenCloth, Material::BlueCloth, Material::BeigeCloth];
        Self {
            board: *random.pick(&[
                Material::WoodRed,
                Material::WoodGreen,
                Material::WoodBlue,
                Material::WoodWhite,
                Material::BlackPlastic,
                Material::YellowPlastic,
            ]),
            awning: if random.chance(0.4) { Some(*random.pick(&cloth)) } else { None },
        }
    }
}

impl Opening {
    /// An opening in the middle of a bay whose storey starts at `z`.
    pub fn new(style: &Style, kind: OpeningKind, bay: [f32; 2], z: f32, storey: f32, gate: Option<[f32; 2]>) -> Self {
        let middle = 0.5 * (bay[0] + bay[1]);
        let width = bay[1] - bay[0];
        let [window, height, sill] = style.window;
        let (half, heights) = match kind {
            OpeningKind::Window => (0.5 * window.min(0.8 * width), [sill, (sill + height).min(storey - 0.3)]),
            OpeningKind::Door => (0.55_f32.min(0.4 * width), [0.0, 2.4]),
            OpeningKind::Shop => (0.5 * width - 0.18, [0.45, 2.6]),
            OpeningKind::Gate => (0.0, [0.0, storey - 0.3]),
        };
        let u = match (kind, gate) {
            (OpeningKind::Gate, Some(gate)) => gate,
            _ => [middle - half, middle + half],
        };
        Self { u, z: heights.map(|h| z + h), kind }
    }

    /// Whether a position on the wall is in the opening.
    pub fn holds(&self, u: f32, z: f32) -> bool {
        (self.u[0]..self.u[1]).contains(&u) && (self.z[0]..self.z[1]).contains(&z)
    }

    /// Draws the reveals and the filling of the opening; `uneven` is the unevenness of the wall.
    #[allow(clippy::too_many_arguments, reason = "a place, its looks and its chance; a struct would be used once")]
    pub fn build(
        &self,
        b: &mut SceneBuilder,
        plan: WallFrame<'_>,
        style: &Style,
        looks: &FacadeSurfaces,
        shop: &Shop,
        uneven: &dyn Fn(f32, f32) -> f32,
        random: &mut Random,
    ) {
        // A style without windows gives them no width.
        if self.u[1] - self.u[0] < 0.1 {
            return;
        }
        let point = |u: f32, z: f32, out: f32| plan(u, z, out + uneven(u, z));
        let rim = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| (self.u[i], self.z[j]));
        // The reveals of a gateway belong to the passage behind it.
        let recess = if self.kind == OpeningKind::Shop { 0.12 } else { style.recess_m };
        for i in 0..4 {
            let (ua, za) = rim[i];
            let (uc, zc) = rim[(i + 1) % 4];
            if self.kind == OpeningKind::Gate && i == 0 {
                continue;
            }
            let reveal = [point(ua, za, 0.0), point(uc, zc, 0.0), point(uc, zc, -recess), point(ua, za, -recess)];
            b.quad(reveal, looks.trim);
        }
        let pane = rim.map(|(u, z)| point(u, z, -recess));
        match self.kind {
            OpeningKind::Window => {
                b.quad(pane, looks.glass);
                self.window(b, plan, &point, style, looks, random);
            }
            OpeningKind::Door => {
                b.quad(pane, looks.door);
                self.door(b, plan, style, looks);
            }
            OpeningKind::Shop => {
                b.quad(pane, looks.glass);
                self.shop(b, plan, looks, shop, random);
            }
            OpeningKind::Gate => {}
        }
    }

    fn window(
        &self,
        b: &mut SceneBuilder,
        plan: WallFrame<'_>,
        point: &dyn Fn(f32, f32, f32) -> Vec3,
        style: &Style,
        looks: &FacadeSurfaces,
        random: &mut Random,
    ) {
        let [u0, u1] = self.u;
        let [z0, z1] = self.z;
        let mut bar = |u: [f32; 2], z: [f32; 2]| {
            let corners = [(u[0], z[0]), (u[1], z[0]), (u[1], z[1]), (u[0], z[1])];
            b.quad(corners.map(|(u, z)| point(u, z, 0.045 - style.recess_m)), looks.frame);
        };
        let middle = 0.5 * (u0 + u1);
        bar([u0, u0 + 0.07], [z0, z1]);
        bar([u1 - 0.07, u1], [z0, z1]);
        bar([u0, u1], [z0, z0 + 0.09]);
        bar([u0, u1], [z1 - 0.07, z1]);
        bar([middle - 0.045, middle + 0.045], [z0, z1]);
        if z1 - z0 > 1.6 {
            let transom = z1 - 0.45;
            bar([u0, u1], [transom - 0.035, transom + 0.035]);
        }
        // One in five has its blind half down.
        if random.chance(0.2) {
            let lower = z0 + random.range(0.3, 0.8) * (z1 - z0);
            let corners = [(u0 + 0.07, lower), (u1 - 0.07, lower), (u1 - 0.07, z1), (u0 + 0.07, z1)];
            b.quad(corners.map(|(u, z)| point(u, z, 0.02 - style.recess_m)), looks.frame);
        }
        block(b, plan, [u0 - 0.08, u1 + 0.08], [z0 - 0.08, z0], [-style.recess_m, 0.09], looks.trim);
        if style.surrounds {
            for u in [[u0 - 0.16, u0], [u1, u1 + 0.16]] {
                block(b, plan, u, [z0, z1], [-0.05, 0.05], looks.trim);
            }
            block(b, plan, [u0 - 0.2, u1 + 0.2], [z1, z1 + 0.2], [-0.05, 0.07], looks.trim);
            if z1 - z0 > 1.9 {
                block(b, plan, [u0 - 0.28, u1 + 0.28], [z1 + 0.2, z1 + 0.29], [-0.05, 0.2], looks.trim);
            }
        }
        if let Some(material) = style.shutters {
            let shutter = b.surface(Building, 0, material);
            let wide = 0.5 * (u1 - u0);
            for u in [[u0 - wide - 0.02, u0 - 0.02], [u1 + 0.02, u1 + wide + 0.02]] {
                block(b, plan, u, self.z, [0.02, 0.08], shutter);
            }
        }
    }

    fn door(&self, b: &mut SceneBuilder, plan: WallFrame<'_>, style: &Style, looks: &FacadeSurfaces) {
        let [u0, u1] = self.u;
        let [z0, z1] = self.z;
        let back = -style.recess_m;
        // Panels protrude from the leaf, with a window above it.
        for z in [[z0 + 0.2, z0 + 0.75], [z0 + 0.9, z0 + 1.85]] {
            block(b, plan, [u0 + 0.14, u1 - 0.14], z, [back, back + 0.03], looks.door);
        }
        block(b, plan, [u0 + 0.06, u1 - 0.06], [z1 - 0.35, z1 - 0.06], [back, back + 0.02], looks.glass);
        let handle = plan(u1 - 0.1, z0 + 1.05, back + 0.06);
        b.add(Shape::Sphere { center: handle, radius: 0.035 }, looks.iron);
        for u in [[u0 - 0.18, u0], [u1, u1 + 0.18]] {
            block(b, plan, u, [z0, z1], [-0.05, 0.07], looks.trim);
        }
        block(b, plan, [u0 - 0.25, u1 + 0.25], [z1, z1 + 0.22], [-0.05, 0.14], looks.trim);
        block(b, plan, [u0 - 0.1, u1 + 0.1], [-0.3, 0.12], [back, 0.25], looks.trim);
    }

    fn shop(
        &self,
        b: &mut SceneBuilder,
        plan: WallFrame<'_>,
        looks: &FacadeSurfaces,
        shop: &Shop,
        random: &mut Random,
    ) {
        let [u0, u1] = self.u;
        let [z0, z1] = self.z;
        let board = b.surface(Building, 0, shop.board);
        block(b, plan, [u0 - 0.16, u1 + 0.16], [z1 + 0.05, z1 + 0.6], [-0.02, 0.13], board);
        block(b, plan, [u0, u1], [z0 - 0.4, z0], [-0.02, 0.06], board);
        for u in [[u0 - 0.16, u0], [u1, u1 + 0.16]] {
            block(b, plan, u, [z0 - 0.4, z1], [-0.02, 0.1], board);
        }
        // Letters on the board, the frame of the pane.
        let letters = b.surface(
            Building,
            0,
            if shop.board == Material::WoodWhite { Material::BlackPlastic } else { Material::WhitePlastic },
        );
        let mut u = u0 + random.range(0.2, 0.5);
        while u + 0.25 < u1 {
            let wide = random.range(0.08, 0.2);
            block(b, plan, [u, u + wide], [z1 + 0.2, z1 + 0.45], [0.12, 0.15], letters);
            u += wide + 0.06;
        }
        let middle = 0.5 * (u0 + u1);
        for u in [u0 + 0.03, middle, u1 - 0.03] {
            block(b, plan, [u - 0.03, u + 0.03], [z0, z1], [-0.12, -0.06], looks.iron);
        }
        if let Some(cloth) = shop.awning {
            let cloth = b.surface(Building, 0, cloth);
            awning(b, plan, [u0 - 0.1, u1 + 0.1], z1 + 0.1, cloth, looks.iron);
        } else if random.chance(0.3) {
            // A sign that hangs over the sidewalk.
            let at = u1 + 0.1;
            b.add(Shape::cylinder(plan(at, z1 + 0.9, 0.0), plan(at, z1 + 0.9, 0.8), 0.02), looks.iron);
            let corners = [(0.2, 0.35), (0.8, 0.35), (0.8, 0.85), (0.2, 0.85)];
            b.quad(corners.map(|(out, up)| plan(at, z1 + up, out)), board);
        }
    }
}

/// A cloth on two arms that slopes 1.3 m out over the sidewalk, with a valance.
fn awning(b: &mut SceneBuilder, plan: WallFrame<'_>, u: [f32; 2], z: f32, cloth: SurfaceId, iron: SurfaceId) {
    let out = 1.3;
    let low = z - 0.45;
    let corner = |i: usize, z: f32, out: f32| plan(u[i], z, out);
    b.quad([corner(0, z, 0.1), corner(1, z, 0.1), corner(1, low, out), corner(0, low, out)], cloth);
    b.quad([corner(0, low, out), corner(1, low, out), corner(1, low - 0.22, out), corner(0, low - 0.22, out)], cloth);
    for end in u {
        b.add(Shape::cylinder(plan(end, z - 0.7, 0.0), plan(end, low, out), 0.015), iron);
    }
}
