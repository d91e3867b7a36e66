//! Refines the relative pose of two keyframes: robust point-to-plane registration.

use super::keyframe::SurfacePoint;
use crate::graph::moved;
use geometry::Pose;
use nalgebra::{Matrix6, Vector6};
use registration::{Kernel, LocalMap, MapPoint, Weights};

/// Search radius for surfaces, m: the largest that a map allows.
const RADIUS_M: f64 = 0.5;
/// Robust scales, m, and the largest number of rounds of each: first the error of the guess, then the scale that the
/// map's spacing allows.
const SCALES: [(f64, usize); 2] = [(0.3, 8), (0.05, 16)];
/// A smaller step ends the rounds of a scale, m and rad: a sixtieth of [`FitFloor::LOOP`], also at a distance of 40 m.
const SETTLED_M: f64 = 5e-4;
const SETTLED_RAD: f64 = 1e-5;
/// Fewer matches are not used as a measurement.
const MIN_MATCHES: u32 = 300;
/// Error of a residual, m. Matches on one wall have correlated errors, so it is larger than the noise.
const RESIDUAL_M: f64 = 0.2;

/// Least standard deviations of a fit with any number of matches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitFloor {
    /// Translation, m.
    pub m: f64,
    /// Rotation, rad.
    pub rad: f64,
}

impl FitFloor {
    /// Two views of a town from different positions, thinned during the drive, do not agree better.
    pub const LOOP: Self = Self { m: 0.03, rad: 0.001 };
}

/// A refined pose.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The pose.
    pub target_from_source: Pose,
    /// Share of the source's points near a surface of the target.
    pub matched: f64,
    /// Weighted root mean square distance of surfaces, m.
    pub rms_m: f64,
    /// Inverse covariance: translation in the target's axes, rotation in the source's.
    pub information: Matrix6<f64>,
}

/// The surfaces of a keyframe, searchable by position.
pub fn surface_map(surfaces: &[SurfacePoint]) -> LocalMap {
    let point = |surface: &SurfacePoint| MapPoint {
        lever: 0.0,
        turn_lever: 0.0,
        position: surface.position.coords.into(),
        normal: surface.normal.cast::<f32>().into(),
        batch: 0,
    };
    LocalMap::from_points(&surfaces.iter().map(point).collect::<Vec<_>>())
}

/// Refines a guess that is accurate within half a metre. `None` if there are too few matches.
pub fn refine(target: &LocalMap, source: &[SurfacePoint], guess: &Pose, floor: FitFloor) -> Option<Fit> {
    let mut target_from_source = *guess;
    let mut last = None;
    for (scale_m, max_rounds) in SCALES {
        for _ in 0..max_rounds {
            let round = Round::new(target, source, &target_from_source, scale_m)?;
            // Degenerate directions (along a tunnel) keep the guess.
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
        information: information(&round.h, &target_from_source, floor)?,
        target_from_source,
        matched: f64::from(round.n_matched) / source.len() as f64,
        rms_m: (round.squares / round.weight).sqrt(),
    })
}

/// Normal equations of all matches at one pose.
struct Round {
    h: Matrix6<f64>,
    g: Vector6<f64>,
    weight: f64,
    squares: f64,
    n_matched: u32,
}

impl Round {
    /// Sums over the matches; `None` if there are too few.
    fn new(target: &LocalMap, source: &[SurfacePoint], target_from_source: &Pose, scale_m: f64) -> Option<Self> {
        let kernel = Kernel { radius_m: RADIUS_M, weights: Weights::Compact };
        let mut sum = Self { h: Matrix6::zeros(), g: Vector6::zeros(), weight: 0.0, squares: 0.0, n_matched: 0 };
        for point in source {
            let position = target_from_source * point.position;
            let normal = target_from_source.rotation * point.normal;
            let Some(surface) = target.surface(position.coords.into(), &normal.cast(), &kernel) else { continue };
            let r = surface.distance_m;
            let weight = 1.0 / (1.0 + (r / scale_m).powi(2));
            // In source axes a motion (v, w) shifts the point by R (v + w x p).
            let n_in = target_from_source.rotation.inverse() * surface.normal;
            let torque = point.position.coords.cross(&n_in);
            let j = Vector6::new(n_in.x, n_in.y, n_in.z, torque.x, torque.y, torque.z);
            sum.h += j * j.transpose() * weight;
            sum.g += j * (r * weight);
            sum.weight += weight;
            sum.squares += weight * r * r;
            sum.n_matched += 1;
        }
        (sum.n_matched >= MIN_MATCHES).then_some(sum)
    }
}

fn information(h: &Matrix6<f64>, target_from_source: &Pose, floor: FitFloor) -> Option<Matrix6<f64>> {
    // A weak prior keeps directions without any match finite: a kilometre, a radian.
    let loose = Vector6::new(1e-6, 1e-6, 1e-6, 1.0, 1.0, 1.0);
    let covariance = (h / (RESIDUAL_M * RESIDUAL_M) + Matrix6::from_diagonal(&loose)).try_inverse()?;
    let m = floor.m * floor.m;
    let rad = floor.rad * floor.rad;
    let covariance = covariance + Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad));
    // The steps are in source axes; the graph expects translations in target axes.
    let mut axes = Matrix6::identity();
    axes.fixed_view_mut::<3, 3>(0, 0).copy_from(target_from_source.rotation.to_rotation_matrix().matrix());
    let information = (axes * covariance * axes.transpose()).try_inverse()?;
    // Rounding makes the matrix slightly asymmetric.
    Some((information + information.transpose()) * 0.5)
}
