//! The mounting of the first LiDAR in the body, from surfaces that it sees in several passes along a given path.
//!
//! The path places each feature. With a wrong mounting, one surface lies at several places: the road ahead and behind at other
//! heights (pitch), the road on the left and on the right of opposite lanes (roll), walls along opposite lanes shifted along
//! the track (heading). The mounting is optimized until the surfaces coincide. Each further drive has an offset of its own within
//! the deviations of its path, so the receiver does not bend the mounting.

mod pairs;
mod views;

use crate::error::RigError;
use crate::survey::SurveySettings;
use drive::Drive;
use geometry::{Isometry3, Pose, UnitQuaternion, Vector3};
use nalgebra::{DMatrix, DVector};
use pairs::{Pair, pairs};
use rayon::prelude::*;
use views::{Passes, View};

/// Number of groups of features whose results are compared.
const GROUPS: usize = 6;
/// Parameters of the mounting: position, then rotation.
const MOUNTING: usize = 6;
/// Parameters of the offset of a further drive.
const OFFSET: usize = 3;
/// Longest range, m, and scale of the residuals, m, of each round. Near features tolerate large rotations: 3 degrees are 0.3 m at 6 m.
const ROUNDS: [Round; 10] = [
    Round { range_m: 6.0, scale_m: 0.2 },
    Round { range_m: 6.0, scale_m: 0.2 },
    Round { range_m: 12.0, scale_m: 0.2 },
    Round { range_m: 12.0, scale_m: 0.1 },
    Round { range_m: 25.0, scale_m: 0.1 },
    Round { range_m: 25.0, scale_m: 0.1 },
    Round { range_m: 40.0, scale_m: 0.1 },
    Round { range_m: 40.0, scale_m: 0.05 },
    Round { range_m: 40.0, scale_m: 0.05 },
    Round { range_m: 40.0, scale_m: 0.05 },
];
/// Fewer pairs of features determine nothing.
const MIN_PAIRS: usize = 500;
/// Error of a residual, m, and number of neighboring features that count as one: their errors are correlated.
const RESIDUAL_M: f64 = 0.05;
const PER_MEASUREMENT: f64 = 10.0;
/// Prior standard deviations of the error of the mounting, m and rad.
const PRIOR_M: f64 = 0.3;
const PRIOR_RAD: f64 = 0.1;
/// Largest standard deviations of a determined value, m and rad.
const DETERMINED_M: f64 = 0.05;
const DETERMINED_RAD: f64 = 0.002;

#[derive(Clone, Copy)]
struct Round {
    range_m: f64,
    scale_m: f64,
}

/// The mounting of the first LiDAR, estimated from several passes.
#[derive(Clone, Debug, PartialEq)]
pub struct Boresight {
    /// Measured minus stated position along the axes of the body, m.
    pub shift_m: [f64; 3],
    /// Rotation from the stated to the measured axes about x (roll), y (pitch) and z (heading) of the body, rad.
    pub turn: [f64; 3],
    /// Standard deviations of shift (m) and turn (rad). Errors of the attitude of the paths are included.
    pub sigmas: [f64; 6],
    /// Number of pairs of features.
    pub n_pairs: usize,
    /// Root mean square distance of the surfaces before and after, m.
    pub rms_m: [f64; 2],
}

/// Normal equations at a mounting.
struct Equations {
    all: Sums,
    groups: Vec<Sums>,
    n_pairs: usize,
}

/// Sums over pairs of features.
#[derive(Clone)]
struct Sums {
    h: DMatrix<f64>,
    b: DVector<f64>,
    weight: f64,
    squares: f64,
}

impl Boresight {
    /// Whether the passes determine a value: indices 0 to 2 are the shift, 3 to 5 the rotation.
    pub fn is_determined(&self, index: usize) -> bool {
        self.sigmas[index] < if index < 3 { DETERMINED_M } else { DETERMINED_RAD }
    }

    /// Compares the passes of drives of one vehicle. The first drive is read as the settings say, the others whole. `None` if the
    /// passes have hardly any surface in common. An error if a drive has no path or has another mounting.
    pub fn measure(drives: &[&Drive], settings: &SurveySettings) -> Result<Option<Self>, RigError> {
        let passes = Passes::read(drives, settings)?;
        let Some(stated) = drives.first().map(|drive| drive.rig().body_from_lidar) else { return Ok(None) };
        Ok(solve(&passes, &stated))
    }
}

fn solve(passes: &Passes, stated: &Pose) -> Option<Boresight> {
    let n = MOUNTING + OFFSET * (passes.n_drives() - 1);
    let sigmas = |index: usize| match index {
        0..3 => PRIOR_M,
        3..MOUNTING => PRIOR_RAD,
        _ => passes.offset_sigma_m((index - MOUNTING) / OFFSET + 1),
    };
    let prior = DMatrix::from_diagonal(&DVector::from_fn(n, |index, _| (RESIDUAL_M / sigmas(index)).powi(2)));
    let mut mounting = *stated;
    let mut offsets = vec![Vector3::zeros(); passes.n_drives()];
    let mut last = None;
    for round in ROUNDS {
        let equations = normal_equations(passes, &mounting, &offsets, round, n)?;
        let all = &equations.all;
        // The prior holds the whole error, not the step.
        let so_far = so_far(stated, &mounting, &offsets);
        let inverse = (&all.h + &prior).try_inverse()?;
        let step = &inverse * (&all.b - &prior * so_far);
        mounting = moved(&mounting, &step);
        for (drive, offset) in offsets.iter_mut().enumerate().skip(1) {
            *offset += step.fixed_rows::<3>(MOUNTING + OFFSET * (drive - 1));
        }
        last = Some((inverse, equations));
    }
    let (covariance, Equations { all, groups, n_pairs }) = last?;
    let found = so_far(stated, &mounting, &offsets);
    let steps: Vec<DVector<f64>> =
        groups.iter().filter_map(|group| Some((&group.h + &prior).try_inverse()? * &group.b)).collect();
    let n_groups = steps.len().max(2) as f64;
    let attitude = passes.attitude_sigma();
    let sigma = |index: usize| {
        let by_pairs = RESIDUAL_M * (covariance[(index, index)] * PER_MEASUREMENT).sqrt();
        let squares: f64 = steps.iter().map(|step| step[index] * step[index]).sum();
        let scatter = (squares / (n_groups - 1.0) / n_groups).sqrt();
        let of_path = if index < 3 { 0.0 } else { attitude[index - 3] };
        by_pairs.max(scatter).hypot(of_path)
    };
    Some(Boresight {
        shift_m: [found[0], found[1], found[2]],
        turn: [found[3], found[4], found[5]],
        sigmas: std::array::from_fn(sigma),
        n_pairs,
        rms_m: [rms_m(passes, stated, n)?, all.rms_m()],
    })
}

/// Root mean square distance of the surfaces with this mounting in the last round, m.
fn rms_m(passes: &Passes, mounting: &Pose, n: usize) -> Option<f64> {
    let offsets = vec![Vector3::zeros(); passes.n_drives()];
    Some(normal_equations(passes, mounting, &offsets, ROUNDS[ROUNDS.len() - 1], n)?.all.rms_m())
}

/// The normal equations of all pairs at a mounting. `None` with too few pairs.
fn normal_equations(
    passes: &Passes,
    mounting: &Pose,
    offsets: &[Vector3<f64>],
    round: Round,
    n: usize,
) -> Option<Equations> {
    /// Pairs of a part: parts are summed up in their order, so the number of threads changes no bit.
    const PART: usize = 1 << 14;
    let views: Vec<&View> = passes.views.iter().filter(|view| view.range_m() < round.range_m).collect();
    let pairs = pairs(&views, mounting, offsets);
    if pairs.len() < MIN_PAIRS {
        return None;
    }
    let parts: Vec<Vec<Sums>> = pairs
        .par_chunks(PART)
        .map(|pairs| {
            let mut groups = vec![Sums::zeros(n); GROUPS];
            for pair in pairs {
                let source = views[pair.source];
                groups[source.group].add(pair, [views[pair.target], source], mounting, round.scale_m);
            }
            groups
        })
        .collect();
    let mut groups = vec![Sums::zeros(n); GROUPS];
    for part in &parts {
        for (sum, part) in groups.iter_mut().zip(part) {
            sum.add_sums(part);
        }
    }
    let mut all = Sums::zeros(n);
    for group in &groups {
        all.add_sums(group);
    }
    Some(Equations { all, groups, n_pairs: pairs.len() })
}

impl Sums {
    fn zeros(n: usize) -> Self {
        Self { h: DMatrix::zeros(n, n), b: DVector::zeros(n), weight: 0.0, squares: 0.0 }
    }

    /// Weighted root mean square distance, m.
    fn rms_m(&self) -> f64 {
        (self.squares / self.weight).sqrt()
    }

    fn add_sums(&mut self, other: &Self) {
        self.h += &other.h;
        self.b += &other.b;
        self.weight += other.weight;
        self.squares += other.squares;
    }

    /// Adds the distance of the source from the surface of the target.
    fn add(&mut self, pair: &Pair, [target, source]: [&View; 2], mounting: &Pose, scale_m: f64) {
        let mut j = DVector::zeros(self.b.len());
        for (view, sign) in [(target, -1.0), (source, 1.0)] {
            let in_body = view.world_from_body.rotation.inverse() * pair.normal;
            let by_turn = (mounting.rotation * view.p_in_lidar()).cross(&in_body);
            for axis in 0..3 {
                j[axis] += sign * in_body[axis];
                j[3 + axis] += sign * by_turn[axis];
                if view.drive > 0 {
                    j[MOUNTING + OFFSET * (view.drive - 1) + axis] += sign * pair.normal[axis];
                }
            }
        }
        let r = pair.distance_m;
        let weight = (1.0 + (r / scale_m).powi(2)).powi(-2);
        self.h.ger(weight, &j, &j, 1.0);
        self.b.axpy(-r * weight, &j, 1.0);
        self.weight += weight;
        self.squares += weight * r * r;
    }
}

/// The mounting after a shift along the axes of the body and a rotation about axes of the body through the LiDAR.
fn moved(mounting: &Pose, step: &DVector<f64>) -> Pose {
    let shift = Vector3::new(step[0], step[1], step[2]);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[3], step[4], step[5]));
    Isometry3::from_parts((mounting.translation.vector + shift).into(), turn * mounting.rotation)
}

/// Difference from the stated mounting and offsets of zero, in the order of the parameters.
fn so_far(stated: &Pose, mounting: &Pose, offsets: &[Vector3<f64>]) -> DVector<f64> {
    let shift = mounting.translation.vector - stated.translation.vector;
    let turn = (mounting.rotation * stated.rotation.inverse()).scaled_axis();
    let offsets = offsets.iter().skip(1).flat_map(|offset| offset.iter());
    let all: Vec<f64> = shift.iter().chain(turn.iter()).chain(offsets).copied().collect();
    DVector::from_vec(all)
}
