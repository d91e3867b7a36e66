//! The mounting of a LiDAR relative to the first one, from the surfaces that both measure.
//!
//! The planar features of the first LiDAR, transformed by the surveyed motion, form a map. The mounting of the other
//! LiDAR is optimized until its own features lie on the surfaces of that map.

use crate::error::RigError;
use crate::survey::{Survey, SurveySettings};
use drive::{Drive, SweepInfo, SweepSource};
use geometry::{Isometry3, Pose, Stamp, UnitQuaternion, Vector3};
use lidar::SweepPoint;
use messages::{SweepHeader, SweepPoint as Row};
use nalgebra::{Matrix6, Point3, Vector6};
use registration::{
    Feature, FeatureSettings, Kernel, LocalMap, MapPoint, MapSettings, Revolution, Sweep, Weights, planar_features,
};

/// Largest number of used sweeps; longer surveys are sampled evenly.
const MAX_SWEEPS: usize = 150;
/// Number of consecutive groups of sweeps whose results are compared.
const GROUPS: usize = 6;
/// Longest range, m, search radius, m, and scale of the residuals, m, of each round. Near features tolerate large
/// rotations.
const ROUNDS: [[f64; 3]; 12] = [
    [6.0, 0.5, 0.3],
    [6.0, 0.5, 0.3],
    [10.0, 0.5, 0.3],
    [10.0, 0.5, 0.3],
    [20.0, 0.5, 0.3],
    [20.0, 0.5, 0.2],
    [60.0, 0.5, 0.2],
    [60.0, 0.5, 0.1],
    [60.0, 0.4, 0.1],
    [60.0, 0.4, 0.05],
    [60.0, 0.4, 0.05],
    [60.0, 0.4, 0.05],
];
/// Least number of features on surfaces of the map.
const MIN_MATCHES: usize = 300;
/// Error of a residual, m.
const RESIDUAL_M: f64 = 0.05;
/// Number of neighboring features and sweeps that count as one: their errors are correlated.
const PER_MEASUREMENT: f64 = 10.0;
/// Prior standard deviations of the mounting error, m and rad.
const PRIOR: [f64; 2] = [0.5, 0.2];
/// Largest standard deviations of a determined value, m and rad.
const DETERMINED: [f64; 2] = [0.1, 0.02];
/// Largest distance of a feature that lies on its surface, m.
const ON_SURFACE_M: f64 = 0.1;

/// The mounting of a secondary LiDAR, estimated from the data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecondaryMounting {
    /// Estimated `body_from_lidar`.
    pub body_from_lidar: Pose,
    /// Measured minus stated position along the axes of the body, m.
    pub shift_m: [f64; 3],
    /// Rotation vector from the stated to the measured axes, in the axes of the LiDAR, rad.
    pub turn: [f64; 3],
    /// Standard deviations of shift (m) and turn (rad).
    pub sigmas: [f64; 6],
    /// Number of features near a surface of the map.
    pub n_matches: usize,
    /// Share of these features that lie on the surface.
    pub on_surface: f64,
}

impl SecondaryMounting {
    /// Whether the drive determines a value: indices 0 to 2 are the shift, 3 to 5 the rotation.
    pub fn is_determined(&self, index: usize) -> bool {
        self.sigmas[index] < DETERMINED[index / 3]
    }

    /// Compares a LiDAR with the first one over the surveyed part of a drive. `index` is the index of the LiDAR in the
    /// drive. `None` if it has no data, or hardly any surface in common with the first one.
    pub fn measure(
        drive: &Drive,
        survey: &Survey,
        settings: &SurveySettings,
        index: usize,
    ) -> Result<Option<Self>, RigError> {
        let Some(lidar) = drive.lidars().nth(index).filter(|lidar| !lidar.files.is_empty()) else { return Ok(None) };
        let Some(stated) = index.checked_sub(1).and_then(|other| drive.rig().body_from_other_lidars.get(other)) else {
            return Ok(None);
        };
        let mut first = drive.sweeps()?;
        let mut other = SweepSource::open(lidar)?;
        SweepSource::separate([&mut first, &mut other]);
        let every = survey.poses.len().div_ceil(MAX_SWEEPS).max(1);
        let mut scene = Scene { survey, settings, map: LocalMap::default(), seen: Vec::new() };
        let mut number = 0_usize;
        let n_rings = lidar.lidar.n_rings();
        let body_from_first = drive.rig().body_from_lidar;
        loop {
            let mut rows = Vec::new();
            let Some(sweep) = first.next_sweep(|points| rows.extend_from_slice(points))? else { break };
            if sweep.stamp >= survey.span[1] {
                break;
            }
            let end = sweep.stamp.plus_nanos(i64::from(sweep.duration_nanos));
            let mut others = Vec::new();
            let slice = other.next_slice([sweep.stamp.0, end.0], |points| others.extend_from_slice(points))?;
            number += 1;
            if sweep.stamp < survey.span[0] || !number.is_multiple_of(every) {
                continue;
            }
            scene.add_first(&sweep, drive.lidar().n_rings(), &rows, &body_from_first);
            if let Some(slice) = slice
                && let Some(stamp) = slice.stamp
            {
                scene.add_other(stamp, slice.has_times, n_rings, &others, stated);
            }
        }
        Ok(scene.solve(stated))
    }
}

/// A feature, and the pose of the body at its time.
struct PosedFeature {
    odom_from_body: Pose,
    feature: Feature,
}

/// Normal equations at a given mounting.
struct MountingSums {
    groups: [Sums; GROUPS],
    /// Number of features near a surface.
    n_matches: usize,
    /// Number of features on it.
    n_on_surface: usize,
}

/// A feature of the other LiDAR, and the pose of the body at its time.
struct Seen {
    odom_from_body: Pose,
    feature: Feature,
    group: usize,
}

struct Scene<'a> {
    survey: &'a Survey,
    settings: &'a SurveySettings,
    map: LocalMap,
    seen: Vec<Seen>,
}

/// Sums of the normal equations.
#[derive(Clone, Copy, Default)]
struct Sums {
    h: Matrix6<f64>,
    b: Vector6<f64>,
}

impl Scene<'_> {
    fn add_first(&mut self, sweep: &SweepInfo, n_rings: usize, rows: &[SweepPoint], body_from_lidar: &Pose) {
        let header = header(sweep.has_times, n_rings);
        let features = self.features(sweep.stamp, &header, sweep.duration_nanos, rows, body_from_lidar);
        let place = |PosedFeature { odom_from_body, feature }: &PosedFeature| {
            let pose = odom_from_body * body_from_lidar;
            MapPoint {
                position: (pose * Point3::from(feature.position).cast::<f64>()).coords.into(),
                normal: (pose.rotation * Vector3::from(feature.normal).cast::<f64>()).cast::<f32>().into(),
                lever: feature.lever,
                turn_lever: 0.0,
                batch: 0,
            }
        };
        let points: Vec<MapPoint> = features.iter().map(place).collect();
        let settings = MapSettings { batches: u32::MAX, max_points: 2_000_000, ..MapSettings::default() };
        self.map.insert(0, &points, &settings);
    }

    fn add_other(&mut self, stamp: Stamp, has_times: bool, n_rings: usize, rows: &[Row], body_from_lidar: &Pose) {
        let header = header(has_times, n_rings);
        let group = self.group(stamp);
        let features = self.features(stamp, &header, 0, rows, body_from_lidar);
        let seen = |PosedFeature { odom_from_body, feature }| Seen { odom_from_body, feature, group };
        self.seen.extend(features.into_iter().map(seen));
    }

    fn group(&self, stamp: Stamp) -> usize {
        let [begin, end] = self.survey.span;
        let share = stamp.seconds_since(begin) / end.seconds_since(begin).max(1e-9);
        ((share * GROUPS as f64).max(0.0) as usize).min(GROUPS - 1)
    }

    /// The features of a sweep with the poses of the body at their times.
    fn features(
        &self,
        stamp: Stamp,
        header: &SweepHeader,
        duration_nanos: u32,
        rows: &[Row],
        body_from_lidar: &Pose,
    ) -> Vec<PosedFeature> {
        let revolution = |spin| Revolution { spin, duration_nanos };
        let untimed = self.settings.untimed_turn.filter(|_| duration_nanos > 0).map(revolution);
        let sweep = Sweep::from_rows(stamp, header, rows, untimed);
        let up = (body_from_lidar.rotation.inverse() * Vector3::z()).cast();
        let settings = FeatureSettings { spacing_m: 0.4, max_range_m: 60.0, ..FeatureSettings::default() };
        let placed = |feature: Feature| {
            let nanos = (f64::from(feature.share) + 0.5) * f64::from(sweep.duration_nanos());
            let odom_from_body = self.survey.trajectory.at(stamp.plus_nanos(nanos as i64))?;
            Some(PosedFeature { odom_from_body, feature })
        };
        planar_features(&sweep, &up, &settings)
            .into_iter()
            .filter(|feature| !feature.is_rough)
            .filter_map(placed)
            .collect()
    }

    fn solve(&self, stated: &Pose) -> Option<SecondaryMounting> {
        let prior = Matrix6::from_diagonal(&Vector6::from_fn(|i, _| (RESIDUAL_M / PRIOR[i / 3]).powi(2)));
        let mut pose = *stated;
        for round in ROUNDS {
            let MountingSums { groups, n_matches, .. } = self.sums(&pose, round);
            if n_matches < MIN_MATCHES {
                return None;
            }
            let all = total(&groups);
            let step = (all.h + prior).try_inverse()? * all.b;
            pose = moved(&pose, &step);
        }
        let last = ROUNDS[ROUNDS.len() - 1];
        let MountingSums { groups, n_matches, n_on_surface } = self.sums(&pose, last);
        let all = total(&groups);
        let covariance = (all.h + prior).try_inverse()?;
        let by_matches = Vector6::from_fn(|i, _| RESIDUAL_M * (covariance[(i, i)] * PER_MEASUREMENT).sqrt());
        let steps: Vec<Vector6<f64>> =
            groups.iter().filter_map(|group| Some((group.h + prior).try_inverse()? * group.b)).collect();
        let n = steps.len().max(2) as f64;
        let scatter = |i: usize| (steps.iter().map(|step| step[i] * step[i]).sum::<f64>() / (n - 1.0) / n).sqrt();
        let turn = (stated.rotation.inverse() * pose.rotation).scaled_axis();
        let shift = pose.translation.vector - stated.translation.vector;
        Some(SecondaryMounting {
            body_from_lidar: pose,
            shift_m: shift.into(),
            turn: turn.into(),
            sigmas: std::array::from_fn(|i| by_matches[i].max(scatter(i))),
            n_matches,
            on_surface: n_on_surface as f64 / n_matches.max(1) as f64,
        })
    }

    fn sums(&self, body_from_lidar: &Pose, [range_m, radius_m, scale_m]: [f64; 3]) -> MountingSums {
        let kernel = Kernel { radius_m, weights: Weights::Compact };
        let mut groups = [Sums::default(); GROUPS];
        let mut n_matches = 0;
        let mut n_on_surface = 0;
        for Seen { odom_from_body, feature, group } in &self.seen {
            let p = Point3::from(feature.position).cast::<f64>();
            if p.coords.norm() > range_m {
                continue;
            }
            let pose = odom_from_body * body_from_lidar;
            let normal = (pose.rotation * Vector3::from(feature.normal).cast::<f64>()).cast::<f32>();
            let Some(surface) = self.map.surface((pose * p).coords.into(), &normal, &kernel) else { continue };
            n_matches += 1;
            let r = surface.distance_m;
            n_on_surface += usize::from(r.abs() < ON_SURFACE_M);
            let in_body = odom_from_body.rotation.inverse() * surface.normal;
            let in_lidar = body_from_lidar.rotation.inverse() * in_body;
            let by_turn = p.coords.cross(&in_lidar);
            let j = Vector6::new(in_body.x, in_body.y, in_body.z, by_turn.x, by_turn.y, by_turn.z);
            let weight = (1.0 + (r / scale_m).powi(2)).powi(-2);
            let sums = &mut groups[*group];
            sums.h += j * j.transpose() * weight;
            sums.b -= j * (r * weight);
        }
        MountingSums { groups, n_matches, n_on_surface }
    }
}

fn header(has_times: bool, n_rings: usize) -> SweepHeader {
    SweepHeader { n_rings: n_rings as u32, has_times: u32::from(has_times), ..SweepHeader::default() }
}

fn total(groups: &[Sums; GROUPS]) -> Sums {
    groups.iter().fold(Sums::default(), |a, group| Sums { h: a.h + group.h, b: a.b + group.b })
}

/// The pose after a shift along body axes and a rotation about its own axes.
fn moved(pose: &Pose, step: &Vector6<f64>) -> Pose {
    let shift = Vector3::new(step[0], step[1], step[2]);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[3], step[4], step[5]));
    Isometry3::from_parts((pose.translation.vector + shift).into(), pose.rotation * turn)
}
