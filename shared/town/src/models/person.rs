//! People: a skeleton of cones and spheres in walking or resting posture. The frame is on the ground, x forward, m.

use super::frame::{At, Frame};
use crate::material::Material;
use crate::scene_builder::{SceneBuilder, SurfaceId};
use messages::ClassId::{Dynamic, Pedestrian};
use nalgebra::Isometry3;
use random::Random;
use raytrace::Primitive;
use std::f32::consts::TAU;

/// Size, clothes and luggage of a person.
#[derive(Clone, Copy, Debug)]
pub struct PersonAppearance {
    /// Height from sole to crown, 1.05 (a child) to 1.95 m.
    pub height_m: f32,
    /// Girth relative to a slim adult of the same height, 0.9 to 1.4.
    pub girth: f32,
    coat: Material,
    legs: Material,
    shoes: Material,
    skin: Material,
    hair: Material,
    bag: Bag,
    skirt: bool,
    hat: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bag {
    None,
    Rucksack,
    Hand,
    Trolley,
}

impl PersonAppearance {
    /// A random appearance; one in seven is a child, one in three carries something.
    pub fn random(random: &mut Random) -> Self {
        let child = random.chance(0.14);
        let height_m = if child { random.range(1.05, 1.5) } else { random.range(1.54, 1.93) };
        let coat = *random.pick(&[
            Material::RedCloth,
            Material::GrayCloth,
            Material::BlackCloth,
            Material::BlackCloth,
            Material::YellowCloth,
            Material::BlueCloth,
            Material::BeigeCloth,
            Material::WhiteCloth,
            Material::GreenCloth,
            Material::Denim,
        ]);
        Self {
            height_m,
            girth: if child { random.range(0.95, 1.1) } else { random.range(0.92, 1.35) },
            coat,
            legs: *random.pick(&[
                Material::Denim,
                Material::Denim,
                Material::BlackCloth,
                Material::GrayCloth,
                Material::BeigeCloth,
            ]),
            shoes: *random.pick(&[Material::Leather, Material::BlackCloth, Material::WhiteCloth]),
            skin: *random.pick(&[Material::SkinLight, Material::SkinLight, Material::SkinBrown, Material::SkinDark]),
            hair: *random.pick(&[Material::HairBlack, Material::HairBrown, Material::HairBlond, Material::HairGray]),
            bag: *random.pick(&[Bag::None, Bag::None, Bag::None, Bag::None, Bag::Rucksack, Bag::Hand, Bag::Trolley]),
            skirt: random.chance(0.15),
            hat: random.chance(0.12),
        }
    }
    /// A person with these clothes and another height, without luggage, skirt and hat.
    #[must_use]
    pub const fn without_luggage(self, height_m: f32) -> Self {
        Self { height_m, bag: Bag::None, skirt: false, hat: false, ..self }
    }
    /// Length of two steps, m: a walker drawn at phase p has covered the share p of it.
    pub fn stride_m(&self) -> f32 {
        // A step spreads the feet by twice the reach of a leg, whose length is two halves.
        8.0 * LEG * self.height_m * SWING.sin()
    }
}

/// Shares of the height: each half of a leg, shoulders above hips, each half of an arm.
const LEG: f32 = 0.245;
const TORSO: f32 = 0.29;
const ARM: f32 = 0.165;
/// Angle of the thighs at the ends of a step, rad.
const SWING: f32 = 0.42;

/// Joint angles, rad, left then right. Limbs hang straight down at 0; forward is positive, and knees bend backward.
#[derive(Clone, Copy, Debug)]
pub struct Posture {
    /// Height of the hips above the ground, m; `None` = the lower foot is on the ground.
    pub hips_m: Option<f32>,
    /// Forward lean of the trunk.
    pub lean: f32,
    /// Angles of the thighs.
    pub thighs: [f32; 2],
    /// Angles of the knees.
    pub knees: [f32; 2],
    /// Angles of the upper arms.
    pub shoulders: [f32; 2],
    /// Angles of the elbows, forward.
    pub elbows: [f32; 2],
    /// Additional distance of the knees compared with walking, m.
    pub straddle: f32,
}

impl Posture {
    /// Posture at a phase of two steps, 0 to 1: the left leg swings forward around 0 and 1.
    pub fn walking(phase: f32) -> Self {
        let (sin, cos) = (TAU * phase).sin_cos();
        Self {
            hips_m: None,
            lean: 0.05,
            thighs: [SWING * sin, -SWING * sin],
            // The swinging leg bends its knee.
            knees: [0.1 + 0.8 * cos.max(0.0), 0.1 + 0.8 * (-cos).max(0.0)],
            shoulders: [-0.38 * sin, 0.38 * sin],
            elbows: [0.35; 2],
            straddle: 0.0,
        }
    }
    /// Standing posture with random arms: hanging, folded, or with a telephone.
    pub fn standing(random: &mut Random) -> Self {
        let (shoulder, elbow) = *random.pick(&[(0.05, 0.15), (0.05, 0.15), (0.35, 1.9), (0.7, 1.7)]);
        let (other, other_elbow) = if random.chance(0.5) { (shoulder, elbow) } else { (0.02, 0.2) };
        let apart = random.range(-0.08, 0.08);
        Self {
            hips_m: None,
            lean: 0.0,
            thighs: [apart, -apart],
            knees: [0.05; 2],
            shoulders: [shoulder, other],
            elbows: [elbow, other_elbow],
            straddle: 0.0,
        }
    }
    /// Posture on a seat of the given height, hands on the knees.
    pub fn sitting(seat_m: f32) -> Self {
        Self {
            hips_m: Some(seat_m + 0.1),
            lean: -0.1,
            thighs: [1.45, 1.5],
            knees: [1.45, 1.5],
            shoulders: [0.5; 2],
            elbows: [0.8; 2],
            straddle: 0.08,
        }
    }
}

/// A walker at a phase of the stride, 0 to 1. Movers show 4 to 8 phases in turn, [`PersonAppearance::stride_m`] apart.
pub fn walker(b: &mut SceneBuilder, instance: u16, phase: f32, appearance: &PersonAppearance) -> Vec<Primitive> {
    let mut f = Frame::for_instance(b, instance);
    figure(&mut f, appearance, &Posture::walking(phase));
    f.model()
}

/// A random person in mid-step.
pub fn model(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let appearance = PersonAppearance::random(random);
    walker(b, instance, random.range(0.0, 1.0), &appearance)
}

/// A standing person.
pub fn standing(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let appearance = PersonAppearance::random(random);
    let mut f = Frame::for_instance(b, instance);
    figure(&mut f, &appearance, &Posture::standing(random));
    f.model()
}

/// A person on a seat of 0.46 m height at the origin, facing x.
pub fn sitting(b: &mut SceneBuilder, instance: u16, random: &mut Random) -> Vec<Primitive> {
    let appearance = PersonAppearance::random(random).without_luggage(random.range(1.55, 1.9));
    let mut f = Frame::for_instance(b, instance);
    figure(&mut f, &appearance, &Posture::sitting(0.46));
    f.model()
}

/// A walker at a phase of the stride who pushes a buggy; the buggy is class dynamic with the same instance.
pub fn with_buggy(b: &mut SceneBuilder, instance: u16, phase: f32, appearance: &PersonAppearance) -> Vec<Primitive> {
    let mut f = Frame::for_instance(b, instance);
    let appearance = PersonAppearance { bag: Bag::None, ..*appearance };
    let walking = Posture::walking(phase);
    figure(&mut f, &appearance, &Posture { shoulders: [0.55; 2], elbows: [0.75; 2], lean: 0.1, ..walking });
    buggy(&mut f.part([0.72, 0.0, 0.0], 0.0));
    f.model()
}

/// Two to four people in conversation within 0.9 m of the pose, facing the center. `instance` returns their instances.
pub fn group(b: &mut SceneBuilder, pose: &Isometry3<f32>, instance: &mut dyn FnMut() -> u16, random: &mut Random) {
    let n = 2 + random.index(3);
    let turn = random.range(0.0, TAU);
    for i in 0..n {
        let angle = turn + TAU * i as f32 / n as f32 + random.range(-0.25, 0.25);
        let out = random.range(0.45, 0.65);
        let model = standing(b, instance(), random);
        let place = nalgebra::Vector3::new(out * angle.cos(), out * angle.sin(), 0.0);
        let facing = angle + std::f32::consts::PI + random.range(-0.3, 0.3);
        b.place(&model, &(pose * Isometry3::new(place, nalgebra::Vector3::z() * facing)));
    }
}

fn buggy(f: &mut Frame<'_>) {
    let [cloth, metal, rubber] =
        [Material::BlueCloth, Material::Steel, Material::Rubber].map(|material| f.surface(Dynamic, material));
    for y in [-0.24, 0.24] {
        for x in [-0.15, 0.4] {
            f.tube([x, y - 0.02, 0.12], [x, y + 0.02, 0.12], 0.12, rubber);
        }
        f.tube([0.4, y, 0.15], [-0.15, y, 0.7], 0.015, metal);
        f.tube([-0.15, y, 0.15], [0.15, y, 0.5], 0.015, metal);
        f.tube([-0.15, y, 0.7], [-0.3, y, 1.0], 0.015, metal);
    }
    f.tube([-0.3, -0.24, 1.0], [-0.3, 0.24, 1.0], 0.018, metal);
    f.quad([[-0.1, -0.2, 0.45], [-0.1, 0.2, 0.45], [0.35, 0.2, 0.4], [0.35, -0.2, 0.4]], cloth);
    f.quad([[-0.1, -0.2, 0.45], [-0.1, 0.2, 0.45], [-0.25, 0.2, 0.85], [-0.25, -0.2, 0.85]], cloth);
    for y in [-0.2, 0.2] {
        f.quad([[-0.1, y, 0.45], [0.35, y, 0.4], [0.3, y, 0.55], [-0.2, y, 0.75]], cloth);
    }
    f.tube([-0.12, -0.21, 0.82], [-0.12, 0.21, 0.82], 0.17, cloth);
}

struct Clothes {
    coat: SurfaceId,
    legs: SurfaceId,
    shoes: SurfaceId,
    skin: SurfaceId,
    hair: SurfaceId,
}

/// Adds a person in a posture. The hips are above the origin of the frame.
pub fn figure(f: &mut Frame<'_>, appearance: &PersonAppearance, posture: &Posture) {
    let clothes = Clothes {
        coat: f.surface(Pedestrian, appearance.coat),
        legs: f.surface(Pedestrian, appearance.legs),
        shoes: f.surface(Pedestrian, appearance.shoes),
        skin: f.surface(Pedestrian, appearance.skin),
        hair: f.surface(Pedestrian, appearance.hair),
    };
    let h = appearance.height_m;
    let reach = |side: usize| {
        let thigh = posture.thighs[side];
        let shin = posture.thighs[side] - posture.knees[side];
        LEG * h * (thigh.cos() + shin.cos())
    };
    // Ankles are 4.5 % of the height above the soles.
    let hips = posture.hips_m.unwrap_or_else(|| reach(0).max(reach(1)) + 0.045 * h);
    for side in [0, 1] {
        leg(f, appearance, posture, side, hips, &clothes);
    }
    let (sin, cos) = posture.lean.sin_cos();
    let up = |along: f32, off: f32| [along * h * sin + off * cos, 0.0, hips + along * h * cos - off * sin];
    trunk(f, appearance, &up, &clothes);
    for side in [0, 1] {
        let [x, _, z] = up(TORSO - 0.02, 0.0);
        let hand = arm(f, appearance, posture, side, [x, z], &clothes);
        if side == 0 && appearance.bag == Bag::Hand {
            let bag = f.surface(Pedestrian, Material::Leather);
            let [x, y, z] = hand;
            f.cuboid([x - 0.16, y - 0.05, z - 0.42], [x + 0.16, y + 0.05, z - 0.14], bag);
            f.tube([x - 0.1, y, z - 0.14], [x, y, z], 0.008, bag);
            f.tube([x + 0.1, y, z - 0.14], [x, y, z], 0.008, bag);
        }
        if side == 1 && appearance.bag == Bag::Trolley {
            trolley(f, hand);
        }
    }
    if appearance.bag == Bag::Rucksack {
        let bag = f.surface(Pedestrian, Material::BlueCloth);
        f.beam(up(0.06, -0.21 * appearance.girth), up(TORSO, -0.21 * appearance.girth), [0.28, 0.16], bag);
    }
}

/// A point at a distance and an angle from another point, in the walking plane.
fn swing([x, y, z]: At, length: f32, angle: f32) -> At {
    [x + length * angle.sin(), y, z - length * angle.cos()]
}

fn leg(f: &mut Frame<'_>, appearance: &PersonAppearance, posture: &Posture, side: usize, hips: f32, clothes: &Clothes) {
    let h = appearance.height_m;
    let g = appearance.girth;
    let y = if side == 0 { 0.052 * h } else { -0.052 * h };
    let thigh = posture.thighs[side];
    let shin = thigh - posture.knees[side];
    let hip = [0.0, y, hips];
    let aside = if side == 0 { 0.5 * posture.straddle } else { -0.5 * posture.straddle };
    let [x, y, z] = swing(hip, LEG * h, thigh);
    let knee = [x, y + aside, z];
    let ankle = swing(knee, LEG * h, shin);
    let skin_below = if appearance.skirt { clothes.skin } else { clothes.legs };
    f.cone(hip, knee, [0.046 * h * g, 0.034 * h], clothes.legs);
    f.ball(knee, 0.034 * h, skin_below);
    f.cone(knee, ankle, [0.034 * h, 0.024 * h], skin_below);
    let [x, y, z] = ankle;
    // Heels lift with the shin.
    let toe = [x + 0.105 * h * (-0.5 * shin).cos(), y, z - 0.025 * h + 0.105 * h * (0.5 * shin).sin().min(0.0)];
    f.beam([x - 0.035 * h, y, z - 0.025 * h], toe, [0.055 * h, 0.04 * h], clothes.shoes);
}

fn trunk(f: &mut Frame<'_>, appearance: &PersonAppearance, up: &dyn Fn(f32, f32) -> At, clothes: &Clothes) {
    let h = appearance.height_m;
    let g = appearance.girth;
    // A body is wider than deep: two cones side by side.
    for y in [-0.035 * h, 0.035 * h] {
        let aside = |[x, _, z]: At| [x, y, z];
        f.cone(aside(up(-0.02, 0.0)), aside(up(TORSO, 0.0)), [0.062 * h * g, 0.066 * h], clothes.coat);
        f.ball(aside(up(TORSO, 0.0)), 0.066 * h, clothes.coat);
        f.ball(aside(up(-0.02, 0.0)), 0.06 * h * g, clothes.legs);
    }
    if appearance.skirt {
        f.cone(up(-0.2, 0.0), up(0.03, 0.0), [0.13 * h * g, 0.09 * h * g], clothes.legs);
    }
    f.tube(up(TORSO, 0.0), up(TORSO + 0.085, 0.01), 0.032 * h, clothes.skin);
    let head = TORSO + 0.125;
    f.ball(up(head, 0.02 * h), 0.056 * h, clothes.skin);
    f.ball(up(head + 0.025, 0.015 * h), 0.058 * h, clothes.skin);
    f.ball(up(head + 0.036, -0.004 * h), 0.06 * h, clothes.hair);
    if appearance.hat {
        f.tube(up(head + 0.055, 0.01 * h), up(head + 0.063, 0.01 * h), 0.1 * h, clothes.shoes);
        f.cone(up(head + 0.06, 0.0), up(head + 0.12, 0.0), [0.065 * h, 0.05 * h], clothes.shoes);
    }
}

fn arm(
    f: &mut Frame<'_>,
    appearance: &PersonAppearance,
    posture: &Posture,
    side: usize,
    [x, z]: [f32; 2],
    clothes: &Clothes,
) -> At {
    let h = appearance.height_m;
    let out = if side == 0 { 0.115 * h } else { -0.115 * h };
    let shoulder = [x, out, z];
    let elbow = swing(shoulder, ARM * h, posture.shoulders[side]);
    let hand = swing(elbow, 0.9 * ARM * h, posture.shoulders[side] + posture.elbows[side]);
    f.ball(shoulder, 0.04 * h, clothes.coat);
    f.cone(shoulder, elbow, [0.034 * h, 0.028 * h], clothes.coat);
    f.ball(elbow, 0.028 * h, clothes.coat);
    f.cone(elbow, hand, [0.028 * h, 0.021 * h], clothes.coat);
    f.ball(hand, 0.028 * h, clothes.skin);
    hand
}

/// A wheeled suitcase pulled by the hand; it belongs to the person, like all luggage.
fn trolley(f: &mut Frame<'_>, [x, y, z]: At) {
    let [case, metal] = [f.surface(Pedestrian, Material::BluePlastic), f.surface(Pedestrian, Material::Steel)];
    let foot = [x - 0.45, y, 0.06];
    f.tube([x, y, z], [x - 0.25, y, 0.55 * z], 0.012, metal);
    f.beam(foot, [x - 0.22, y, 0.6 * z], [0.36, 0.22], case);
}

#[cfg(test)]
mod tests {
    use super::*;
    use random::hash;

    fn ankle(appearance: &PersonAppearance, phase: f32) -> f32 {
        let posture = Posture::walking(phase);
        let knee = swing([0.0; 3], LEG * appearance.height_m, posture.thighs[0]);
        swing(knee, LEG * appearance.height_m, posture.thighs[0] - posture.knees[0])[0]
    }

    #[test]
    fn standing_foot_moves_back_by_half_a_stride() {
        let appearance = PersonAppearance::random(&mut Random::for_hashed_stream(3, 0));
        // The left foot stands between its foremost position at a quarter and its rearmost position at three quarters.
        let back = ankle(&appearance, 0.25) - ankle(&appearance, 0.75);
        assert!(
            (back - 0.5 * appearance.stride_m()).abs() < 0.06 * appearance.stride_m(),
            "{back} of {}",
            appearance.stride_m()
        );
        assert!(appearance.stride_m() > 0.8 && appearance.stride_m() < 1.7, "{}", appearance.stride_m());
    }

    #[test]
    fn walker_keeps_soles_on_ground_and_head_at_height() {
        for i in 0..60_u64 {
            let mut b = SceneBuilder::default();
            let appearance = PersonAppearance::random(&mut Random::for_hashed_stream(hash(1, i), 0));
            let model = walker(&mut b, 1, i as f32 / 60.0, &appearance);
            let low = model.iter().map(|p| p.shape.bounds()[0].z).fold(f32::INFINITY, f32::min);
            let high = model.iter().map(|p| p.shape.bounds()[1].z).fold(f32::NEG_INFINITY, f32::max);
            assert!(low > -0.04 && low < 0.03, "{low}");
            // A step lowers the head by up to 5 cm, a hat adds up to 12 cm.
            assert!(
                high > appearance.height_m - 0.1 && high < appearance.height_m + 0.2,
                "{high} of {}",
                appearance.height_m
            );
        }
    }
}
