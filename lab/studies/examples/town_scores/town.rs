//! A simulated drive as submaps, as the stage `slam_aggregate` would publish them with true poses.

use drive::{Drive, Shot, SweepInfo, TrueLabel};
use geometry::{Point3, Pose, Stamp, Trajectory, Vector3};
use lidar::SweepPoint;
use messages::{ClassRow, SubmapHeader, SubmapPoint, SubmapSweep, pose_numbers};
use segmentation::{ModelInput, Segmenter};
use simulation::{DriveSpec, Town};
use std::path::Path;

/// Length of the submaps of the stage `slam_aggregate`, m.
const SUBMAP_M: f64 = 20.0;
const SUBMAP_NANOS: i64 = 5_000_000_000;
/// Rings of the simulated lidar.
const N_RINGS: u32 = 32;

/// A submap with the truth of its points.
pub struct TownSubmap {
    pub header: Box<SubmapHeader>,
    pub points: Vec<SubmapPoint>,
    pub truth: Vec<TrueLabel>,
}

impl TownSubmap {
    /// True classes, or the classes of a model.
    pub fn classes(&self, model: Option<&dyn Segmenter>) -> Vec<ClassRow> {
        let class = |label: &TrueLabel| ClassRow { class_id: label.class, score: 255 };
        let mut classes: Vec<ClassRow> = self.truth.iter().map(class).collect();
        if let Some(model) = model {
            let cloud = ModelInput::new(&self.header, &self.points);
            model.segment(&cloud, &mut classes).expect("the model takes any cloud");
        }
        classes
    }

    fn begin(odom_from_body: &Pose) -> Self {
        let rotation = geometry::heading(&odom_from_body.rotation);
        let odom_from_submap = Pose::from_parts(odom_from_body.translation, rotation).into();
        let header = SubmapHeader { odom_from_submap, n_rings: N_RINGS, ..SubmapHeader::default() };
        Self { header: Box::new(header), points: Vec::new(), truth: Vec::new() }
    }

    fn push(&mut self, sweep: &SweepInfo, returns: &[SweepPoint], truth: &Truth) {
        let first_point = self.points.len() as u32;
        let sweep_idx = self.header.n_sweeps as u16;
        let submap_from_odom = self.header.odom_from_submap.to_pose().expect("is sound").inverse();
        let pose_at = |nanos: u32| {
            let stamp = Stamp(sweep.stamp.0 + i64::from(nanos));
            Some(submap_from_odom * truth.world_from_body.at(stamp)? * truth.body_from_lidar)
        };
        let ends = pose_at(0).zip(pose_at(sweep.duration_nanos));
        let Some((begin, end)) = ends else { return };
        for found in returns {
            let stamp = sweep.stamp.0 + i64::from(found.offset_nanos);
            let shot = Shot { stamp, ring: found.ring, azimuth: Some(found.azimuth), range_m: None };
            let (Some(pose), Ok(label)) = (pose_at(found.offset_nanos), truth.labels.find(&shot)) else { continue };
            let p_in_submap = pose * Point3::new(found.x, found.y, found.z).cast();
            let [x, y, z] = p_in_submap.coords.map(|v| v as f32).into();
            let offset_nanos = found.offset_nanos;
            let azimuth = found.azimuth;
            let intensity = found.intensity;
            let ring = found.ring;
            let point =
                SubmapPoint { x, y, z, offset_nanos, azimuth, intensity, ring, sweep_idx, ..Default::default() };
            self.points.push(point);
            self.truth.push(label);
        }
        self.header.sweeps[usize::from(sweep_idx)] = SubmapSweep {
            stamp: sweep.stamp.0,
            duration_nanos: sweep.duration_nanos,
            first_point,
            n_points: self.points.len() as u32 - first_point,
            submap_from_lidar_begin: pose_numbers(&begin),
            submap_from_lidar_end: pose_numbers(&end),
            ..SubmapSweep::default()
        };
        self.header.n_sweeps += 1;
    }
}

struct Truth {
    world_from_body: Trajectory,
    labels: drive::TrueLabels,
    body_from_lidar: Pose,
}

/// The submaps of a drive with only the lidar, which is simulated if it does not exist.
pub fn submaps(path: &Path, town: Town, seed: u64, seconds: f64) -> Vec<TownSubmap> {
    if !path.exists() {
        let spec = DriveSpec { town, cameras: false, mosaics: false, ..DriveSpec::urban(seed, seconds) };
        simulation::write_drive(&spec, path, &mut |_| {}).expect("simulates");
    }
    let drive = Drive::open(path).expect("opens");
    let truth = Truth {
        world_from_body: drive.true_trajectory().expect("has a truth").expect("reads"),
        labels: drive.true_labels().expect("has labels"),
        body_from_lidar: drive.rig().body_from_lidar,
    };
    let mut source = drive.sweeps().expect("opens");
    let mut submaps: Vec<TownSubmap> = Vec::new();
    let mut begin: Option<(i64, Vector3<f64>)> = None;
    loop {
        let mut returns = Vec::new();
        let Some(sweep) = source.next_sweep(|found| returns.extend_from_slice(found)).expect("reads") else {
            return submaps;
        };
        let Some(pose) = truth.world_from_body.at(sweep.stamp) else { continue };
        let place = pose.translation.vector;
        let is_full = begin
            .is_none_or(|(stamp, from)| (place - from).norm() >= SUBMAP_M || sweep.stamp.0 - stamp >= SUBMAP_NANOS);
        if is_full {
            begin = Some((sweep.stamp.0, place));
            submaps.push(TownSubmap::begin(&pose));
        }
        if let Some(submap) = submaps.last_mut() {
            submap.push(&sweep, &returns, &truth);
        }
    }
}
