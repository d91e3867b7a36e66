//! False control points in many random draws of errors: two drives in opposite lanes, matches, and control points.

use super::{RunPose, adjust};
use crate::control::SeenControl;
use crate::survey::MIN_WEIGHT;
use geometry::{Isometry3, Point3, Pose, Vector3};
use georeference::RelativePose;
use nalgebra::{Matrix2, Matrix6, Vector6};
use random::Random;

/// Submaps of each drive, and the distance of their origins, m.
const SUBMAPS: usize = 15;
const SPACING_M: f64 = 20.0;
/// Errors that a drive has in common, m horizontally and up, and of its heading, rad. The run states them.
const DRIVE_M: [f64; 2] = [1.0, 1.5];
const DRIVE_RAD: f64 = 0.003;
/// Error of the odometry from submap to submap, m and rad, and the share that the next submap keeps: fixes bound it.
const STEP_M: f64 = 0.02;
const STEP_RAD: f64 = 0.0002;
const KEPT: f64 = 0.9;
/// Errors of a match between drives, m and rad.
const MATCH_M: f64 = 0.01;
const MATCH_RAD: f64 = 0.0003;
/// One match in so many is wrong along the track, by this, m.
const WRONG_MATCH_EVERY: usize = 20;
const WRONG_MATCH_M: f64 = 0.5;
/// Errors of a mark: its coordinates and its picked position, m, along each axis.
const MARK_M: f64 = 0.028;
/// Marks are within this distance of the origin of a submap, m.
const REACH_M: f64 = 10.0;
/// Error of the false mark, m, in a random direction.
const FALSE_M: f64 = 0.5;
/// Upright surfaces of a submap that face along each axis.
const UPRIGHT_SURFACES: f64 = 1000.0;
/// Number of draws.
const DRAWS: u64 = 200;

/// Errors of one draw, and the number of the false mark.
struct Draw {
    truth: Vec<Pose>,
    submaps: Vec<RunPose>,
    matches: Vec<RelativePose>,
    marks: Vec<SeenControl>,
    false_mark: usize,
}

/// What the adjustment says about the marks of a draw.
struct Outcome {
    /// Whether the false mark is refused.
    is_found: bool,
    /// Whether each other mark is used.
    keeps_others: bool,
    /// Largest error of a submap, m.
    off_m: f64,
}

fn gauss(random: &mut Random, sigma: f64) -> f64 {
    f64::from(random.gauss()) * sigma
}

fn vector(random: &mut Random, sigma: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| gauss(random, sigma))
}

fn error(random: &mut Random, m: f64, rad: f64) -> Pose {
    Isometry3::new(vector(random, m), vector(random, rad))
}

/// The street bends by 17 degrees; the second drive comes back in the opposite lane.
fn true_pose(drive: usize, number: usize) -> Pose {
    let along = if drive == 0 { number } else { SUBMAPS - 1 - number } as f64;
    let turned = 0.02 * along;
    let center = Vector3::new(SPACING_M * along, SPACING_M * 0.01 * along * along, 0.05 * along);
    let heading = if drive == 0 { turned } else { turned + std::f64::consts::PI };
    let lane = Vector3::new(-turned.sin(), turned.cos(), 0.0) * if drive == 0 { -1.75 } else { 1.75 };
    Isometry3::new(center + lane, Vector3::z() * heading)
}

impl Draw {
    fn new(seed: u64, n_marks: usize) -> Self {
        let mut random = Random::for_hashed_stream(seed, n_marks as u64);
        let mut truth = Vec::new();
        let mut submaps = Vec::new();
        for drive in 0..2 {
            let [horizontal, up] = DRIVE_M;
            let [x, y] = [gauss(&mut random, horizontal), gauss(&mut random, horizontal)];
            let z = gauss(&mut random, up);
            let common = Isometry3::new(Vector3::new(x, y, z), Vector3::z() * gauss(&mut random, DRIVE_RAD));
            let mut drift = Vector6::zeros();
            for number in 0..SUBMAPS {
                let step = [STEP_M, STEP_M, STEP_M, STEP_RAD, STEP_RAD, STEP_RAD];
                drift = drift * KEPT + Vector6::from(step.map(|sigma| gauss(&mut random, sigma)));
                let own = Isometry3::new(drift.fixed_rows::<3>(0).into(), drift.fixed_rows::<3>(3).into());
                let pose = true_pose(drive, number);
                truth.push(pose);
                submaps.push(RunPose {
                    drive,
                    survey_from_submap: common * pose * own,
                    sigma_m: [horizontal, horizontal, up],
                    sigma_rad: [0.002, 0.002, DRIVE_RAD],
                    // A street in a town.
                    upright: Matrix2::from_diagonal_element(UPRIGHT_SURFACES),
                });
            }
        }
        let matches = (0..2 * SUBMAPS).map(|k| relative(&mut random, &truth, k)).collect();
        let false_mark = random.permutation(n_marks)[0];
        let places = random.permutation(truth.len());
        let marks = (0..n_marks).map(|point| {
            let submap = places[point];
            let p = Point3::from(vector(&mut random, REACH_M / 2.0));
            let direction = vector(&mut random, 1.0).normalize();
            let wrong = direction * if point == false_mark { FALSE_M } else { 0.0 };
            SeenControl {
                point,
                submap,
                p_in_submap: p + vector(&mut random, MARK_M),
                p_in_survey: truth[submap] * p + wrong,
                sigma_m: [Some(MARK_M); 2],
                share: 1.0,
            }
        });
        let marks = marks.collect();
        Self { truth, submaps, matches, marks, false_mark }
    }

    /// The first adjustment without marks, and the second one with them, as a survey does.
    fn outcome(&self) -> Outcome {
        let start: Vec<Pose> = self.submaps.iter().map(|submap| submap.survey_from_submap).collect();
        let first = adjust(&self.submaps, &start, self.matches.clone(), &[]).expect("is determined");
        let second = adjust(&self.submaps, &first.poses, self.matches.clone(), &self.marks).expect("is determined");
        let is_used = |mark: usize| second.control_weights[mark] >= MIN_WEIGHT;
        let off =
            second.poses.iter().zip(&self.truth).map(|(a, b)| (a.translation.vector - b.translation.vector).norm());
        Outcome {
            is_found: !is_used(self.false_mark),
            keeps_others: (0..self.marks.len()).all(|mark| mark == self.false_mark || is_used(mark)),
            off_m: off.fold(0.0, f64::max),
        }
    }
}

/// A match of a submap of the second drive with the nearest one of the first drive, or the one after it.
fn relative(random: &mut Random, truth: &[Pose], k: usize) -> RelativePose {
    let source = SUBMAPS + k / 2;
    let opposite = SUBMAPS - 1 - k / 2;
    let target = if k.is_multiple_of(2) { opposite } else { opposite.saturating_sub(1) };
    let wrong = if k % WRONG_MATCH_EVERY == 7 { WRONG_MATCH_M } else { 0.0 };
    let off = error(random, MATCH_M, MATCH_RAD) * Isometry3::translation(wrong, 0.0, 0.0);
    let sigma = [MATCH_M, MATCH_M, MATCH_M, MATCH_RAD, MATCH_RAD, MATCH_RAD];
    RelativePose {
        target,
        source,
        target_from_source: truth[target].inv_mul(&truth[source]) * off,
        information: Matrix6::from_diagonal(&Vector6::from(sigma.map(|sigma: f64| sigma.powi(-2)))),
    }
}

/// Share of the draws in which a condition holds.
fn share(outcomes: &[Outcome], holds: impl Fn(&Outcome) -> bool) -> f64 {
    outcomes.iter().filter(|outcome| holds(outcome)).count() as f64 / outcomes.len() as f64
}

#[test]
fn false_control_point_of_half_a_metre_is_found_in_nearly_all_draws() {
    for n_marks in [3, 4, 5, 8] {
        let outcomes: Vec<Outcome> = (0..DRAWS).map(|seed| Draw::new(seed, n_marks).outcome()).collect();
        let found = share(&outcomes, |outcome| outcome.is_found);
        let alone = share(&outcomes, |outcome| outcome.is_found && outcome.keeps_others);
        let mut off: Vec<f64> = outcomes.iter().map(|outcome| outcome.off_m).collect();
        off.sort_by(f64::total_cmp);
        let [median, p95] = [0.5, 0.95].map(|share| off[(share * off.len() as f64) as usize]);
        println!(
            "{n_marks} marks, {DRAWS} draws: false one found in {:.1} %, as the only one in {:.1} %; largest error of a submap: median \
             {median:.3} m, 95 % {p95:.3} m",
            100.0 * found,
            100.0 * alone
        );
        if n_marks >= 5 {
            assert!(found >= 0.95 && alone >= 0.92, "{n_marks} marks: {found}, {alone}");
        }
    }
}
