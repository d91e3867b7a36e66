//! Scan context (Kim and Kim, IROS 2018): how high things stand around a place, by range and direction. A turn of the vehicle
//! shifts its columns.

use super::keyframe::SurfacePoint;
use geometry::Pose;

const RINGS: usize = 20;
const SECTORS: usize = 60;
const RING_M: f64 = super::keyframe::REACH_M / RINGS as f64;
/// What lies this far below the vehicle still has a positive height, m: roads fall by 6 % over 40 m.
const GROUND_M: f64 = 4.0;

/// Greatest heights, sector by sector; 0 where nothing is.
pub struct ScanContext(Vec<[f32; RINGS]>);

/// How two contexts lie upon each other best.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Likeness {
    /// 0 the same, 1 nothing in common.
    pub distance: f64,
    /// Turn from the target's to the source's heading, rad, -pi to pi.
    pub turn_rad: f64,
}

impl ScanContext {
    /// Of the surfaces around `frame_from_center`, whose x is the direction of the first sector.
    pub fn new(surfaces: &[SurfacePoint], frame_from_center: &Pose) -> Self {
        let mut sectors = vec![[0.0; RINGS]; SECTORS];
        let center_from_frame = frame_from_center.inverse();
        for surface in surfaces {
            let p = center_from_frame * surface.position;
            let ring = (p.x.hypot(p.y) / RING_M) as usize;
            let turn = p.y.atan2(p.x).rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU;
            let sector = ((turn * SECTORS as f64) as usize).min(SECTORS - 1);
            if ring < RINGS {
                let highest: &mut f32 = &mut sectors[sector][ring];
                *highest = highest.max((p.z + GROUND_M) as f32);
            }
        }
        Self(sectors)
    }

    /// Over all turns, the least mean of `1 - cosine` of columns that both have (eqs. 6 and 7 of the paper); and the least of
    /// those more than a right angle away: a street with houses on both sides looks much the same the other way.
    pub fn likeness(&self, source: &Self) -> [Likeness; 2] {
        let norms = |context: &Self| context.0.iter().map(|column| dot(column, column).sqrt()).collect::<Vec<f32>>();
        let (target_norms, source_norms) = (norms(self), norms(source));
        let distance = |shift: usize| {
            let (mut sum, mut n) = (0.0, 0);
            for (k, column) in self.0.iter().enumerate() {
                // What lies at `k` for the target lies `shift` less for a source that is turned by `shift`.
                let other = (k + SECTORS - shift) % SECTORS;
                let norm = target_norms[k] * source_norms[other];
                if norm > 0.0 {
                    sum += f64::from(1.0 - dot(column, &source.0[other]) / norm);
                    n += 1;
                }
            }
            // Half of the columns must have something to compare.
            if n >= SECTORS / 2 { sum / f64::from(n as u32) } else { 1.0 }
        };
        let distances: Vec<f64> = (0..SECTORS).map(distance).collect();
        let least = |shifts: &mut dyn Iterator<Item = usize>| {
            let shift = shifts.min_by(|a, b| distances[*a].total_cmp(&distances[*b])).unwrap_or(0);
            let turn = shift as f64 / SECTORS as f64 * std::f64::consts::TAU;
            let turn_rad = if turn > std::f64::consts::PI { turn - std::f64::consts::TAU } else { turn };
            (shift, Likeness { distance: distances[shift], turn_rad })
        };
        let (shift, best) = least(&mut (0..SECTORS));
        let quarter = SECTORS / 4;
        let (_, other) = least(&mut (quarter + 1..SECTORS - quarter).map(|away| (shift + away) % SECTORS));
        [best, other]
    }
}

fn dot(a: &[f32; RINGS], b: &[f32; RINGS]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
