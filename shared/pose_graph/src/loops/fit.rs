//! One picture of a place laid onto another: point to plane, robust.

use super::keyframe::SurfacePoint;
use crate::tangent::moved;
use geometry::Pose;
use nalgebra::{Matrix6, Vector6};
use registration::{Kernel, LocalMap, MapPoint, Weights};

/// How far a surface is looked for, m: as far as a map can look.
const REACH_M: f64 = 0.5;
/// Robust scales, m, and rounds with each at most: as far as the guess may be off, then as near as a map's spacing allows.
const SCALES: [(f64, usize); 2] = [(0.3, 8), (0.05, 16)];
/// A scale is done with when a round moves less, m and rad: a sixtieth of [`FLOOR_M`], at 40 m too.
const SETTLED_M: f64 = 5e-4;
const SETTLED_RAD: f64 = 1e-5;
/// Fewer matches are no measurement.
const MIN_MATCHES: u32 = 300;
/// Error of a residual, m: matches at one wall err alike, so it is larger than the noise.
const RESIDUAL_M: f64 = 0.2;
/// What no number of matches takes away, m and rad: how well two looks at a town from two places agree.
const FLOOR_M: f64 = 0.03;
const FLOOR_RAD: f64 = 0.001;

/// A fit.
#[derive(Clone, Debug)]
pub struct Fit {
    pub target_from_source: Pose,
    /// Share of the source's points with a surface of the target in reach.
    pub matched: f64,
    /// Weighted root mean square distance, m.
    pub rms_m: f64,
    /// Inverse covariance: translation in the target's axes, rotation in the source's.
    pub information: Matrix6<f64>,
}

/// The surfaces of a keyframe, to be found by place.
pub fn map_of(surfaces: &[SurfacePoint]) -> LocalMap {
    let point = |surface: &SurfacePoint| MapPoint {
        position: surface.position.coords.into(),
        normal: surface.normal.cast::<f32>().into(),
        batch: 0,
    };
    LocalMap::from_points(&surfaces.iter().map(point).collect::<Vec<_>>())
}

/// From a guess within half a metre. `None` if too little is in reach.
pub fn fit(target: &LocalMap, source: &[SurfacePoint], guess: &Pose) -> Option<Fit> {
    let mut target_from_source = *guess;
    let mut last = None;
    for (scale_m, max_rounds) in SCALES {
        for _ in 0..max_rounds {
            let round = Round::new(target, source, &target_from_source, scale_m)?;
            // What nothing determines (along a tunnel) stays where it is.
            let step = (round.h + Matrix6::identity() * (1e-3 * round.weight)).cholesky()?.solve(&-round.g);
            target_from_source = moved(&target_from_source, &step);
            last = Some(round);
            if step.fixed_rows::<3>(0).norm() < SETTLED_M && step.fixed_rows::<3>(3).norm() < SETTLED_RAD {
                break;
            }
        }
    }
    let round = last?;
    Some(Fit {
        information: information(&round.h, &target_from_source)?,
        target_from_source,
        matched: f64::from(round.n_matched) / source.len() as f64,
        rms_m: (round.squares / round.weight).sqrt(),
    })
}

/// Normal equations of all matches at one place.
struct Round {
    h: Matrix6<f64>,
    g: Vector6<f64>,
    weight: f64,
    squares: f64,
    n_matched: u32,
}

impl Round {
    /// `None` if there are too few.
    fn new(target: &LocalMap, source: &[SurfacePoint], target_from_source: &Pose, scale_m: f64) -> Option<Self> {
        let kernel = Kernel { radius_m: REACH_M, weights: Weights::Compact };
        let mut sum = Self { h: Matrix6::zeros(), g: Vector6::zeros(), weight: 0.0, squares: 0.0, n_matched: 0 };
        for point in source {
            let position = target_from_source * point.position;
            let normal = target_from_source.rotation * point.normal;
            let Some(surface) = target.surface(position.coords.into(), &normal.cast(), &kernel) else { continue };
            let r = surface.distance_m;
            let weight = 1.0 / (1.0 + (r / scale_m).powi(2));
            // Along the axes of the source: a motion (v, w) shifts the point by R (v + w x p).
            let n_in = target_from_source.rotation.inverse() * surface.normal;
            let turn = point.position.coords.cross(&n_in);
            let j = Vector6::new(n_in.x, n_in.y, n_in.z, turn.x, turn.y, turn.z);
            sum.h += j * j.transpose() * weight;
            sum.g += j * (r * weight);
            sum.weight += weight;
            sum.squares += weight * r * r;
            sum.n_matched += 1;
        }
        (sum.n_matched >= MIN_MATCHES).then_some(sum)
    }
}

fn information(h: &Matrix6<f64>, target_from_source: &Pose) -> Option<Matrix6<f64>> {
    // Something tiny keeps a direction without any match finite: a kilometre, a radian.
    let loose = Vector6::new(1e-6, 1e-6, 1e-6, 1.0, 1.0, 1.0);
    let covariance = (h / (RESIDUAL_M * RESIDUAL_M) + Matrix6::from_diagonal(&loose)).try_inverse()?;
    let (m, rad) = (FLOOR_M * FLOOR_M, FLOOR_RAD * FLOOR_RAD);
    let covariance = covariance + Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad));
    // Steps were along the source's axes; the graph wants the target's for translations.
    let mut axes = Matrix6::identity();
    axes.fixed_view_mut::<3, 3>(0, 0).copy_from(target_from_source.rotation.to_rotation_matrix().matrix());
    let information = (axes * covariance * axes.transpose()).try_inverse()?;
    // Rounding leaves it a little skew.
    Some((information + information.transpose()) * 0.5)
}
