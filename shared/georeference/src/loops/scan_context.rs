//! Scan context (Kim and Kim, IROS 2018): the largest height around a place per range ring and direction sector. A
//! rotation of the vehicle shifts the columns.

use super::keyframe::SurfacePoint;
use geometry::Pose;

const RINGS: usize = 20;
const SECTORS: usize = 60;
const RING_M: f64 = super::keyframe::REACH_M / RINGS as f64;
/// Offset added to all heights so that they are positive, m: roads fall by 6 % over 40 m.
const GROUND_M: f64 = 4.0;

/// Largest heights, sector by sector; 0 in empty cells.
pub struct ScanContext(Vec<[f32; RINGS]>);

/// The rotation with the best match of two contexts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContextMatch {
    /// Distance of the contexts: 0 equal, 1 nothing in common.
    pub distance: f64,
    /// Rotation from the target's to the source's heading, rad, -pi to pi.
    pub rotation_rad: f64,
}

impl ScanContext {
    /// Computes the context of the surfaces around `frame_from_center`. Its x axis is the direction of the first
    /// sector.
    pub fn new(surfaces: &[SurfacePoint], frame_from_center: &Pose) -> Self {
        let mut sectors = vec![[0.0; RINGS]; SECTORS];
        let center_from_frame = frame_from_center.inverse();
        for surface in surfaces {
            let p = center_from_frame * surface.position;
            let ring = (p.x.hypot(p.y) / RING_M) as usize;
            let azimuth = p.y.atan2(p.x).rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU;
            let sector = ((azimuth * SECTORS as f64) as usize).min(SECTORS - 1);
            if ring < RINGS {
                let highest: &mut f32 = &mut sectors[sector][ring];
                *highest = highest.max((p.z + GROUND_M) as f32);
            }
        }
        Self(sectors)
    }

    /// The match with the least mean of `1 - cosine` over the columns that both contexts have (eqs. 6 and 7 of the
    /// paper), and the best match more than a right angle away from it: a street with houses on both sides looks
    /// similar in both directions.
    pub fn matches(&self, source: &Self) -> [ContextMatch; 2] {
        let norms = |context: &Self| context.0.iter().map(|column| dot(column, column).sqrt()).collect::<Vec<f32>>();
        let target_norms = norms(self);
        let source_norms = norms(source);
        let distance = |shift: usize| {
            let mut sum = 0.0;
            let mut n = 0;
            for (k, column) in self.0.iter().enumerate() {
                // Column `k` of the target is column `k - shift` of a source that is rotated by `shift`.
                let other = (k + SECTORS - shift) % SECTORS;
                let norm = target_norms[k] * source_norms[other];
                if norm > 0.0 {
                    sum += f64::from(1.0 - dot(column, &source.0[other]) / norm);
                    n += 1;
                }
            }
            // At least half of the columns must be comparable.
            if n >= SECTORS / 2 { sum / f64::from(n as u32) } else { 1.0 }
        };
        let distances: Vec<f64> = (0..SECTORS).map(distance).collect();
        let least = |shifts: &mut dyn Iterator<Item = usize>| {
            let shift = shifts.min_by(|a, b| distances[*a].total_cmp(&distances[*b])).unwrap_or(0);
            let rotation = shift as f64 / SECTORS as f64 * std::f64::consts::TAU;
            let rotation_rad =
                if rotation > std::f64::consts::PI { rotation - std::f64::consts::TAU } else { rotation };
            (shift, ContextMatch { distance: distances[shift], rotation_rad })
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
