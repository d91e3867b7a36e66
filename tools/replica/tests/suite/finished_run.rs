//! The output folder of a run on a simulated drive: the clouds are written by `delivery`, with known classes, errors and poses.

use delivery::{Folder, INDEX, Index, ReceivedColumn, ReceivedSubmap, write_submap};
use drive::{Drive, Shot, SweepInfo, TrueLabel, TrueLabels};
use formats::ply::Kind;
use formats::trajectory::tum_from_trajectory;
use geometry::{Isometry3, Point3, Pose, Stamp, Trajectory, heading, interpolate};
use lidar::SweepPoint;
use messages::columns::{COLUMNS, Column};
use messages::{
    ClassId, ClassRow, ClassTopic, ColorRow, ColorTopic, InstanceTopic, SubmapHeader, SubmapPoint, SubmapSweep, UNSEEN,
    pose_numbers,
};
use std::collections::BTreeMap;
use std::path::Path;

/// Sweeps of a submap.
const SWEEPS: usize = 2;
/// Standard deviations that the run states for each submap.
pub const SIGMA_M: [f32; 3] = [1.2, 0.9, 0.5];

/// The run, and hand counts of what it contains.
#[derive(Default)]
pub struct FinishedRun {
    pub n_points: u64,
    pub n_submaps: u64,
    pub n_colored: u64,
    /// Points by true and predicted class.
    pub by_class: BTreeMap<(u8, u8), u64>,
    /// Points of each true pedestrian, and how many of them keep an instance.
    pub pedestrians: BTreeMap<u16, [u64; 2]>,
}

/// A column of the table.
fn column(name: &str) -> &'static Column {
    COLUMNS.iter().find(|column| column.name == name).expect(name)
}

/// How a run is written.
pub struct RunOptions {
    /// Error of all poses: east and up, m.
    pub off_m: [f64; 2],
    /// Added to the time of all points, ns.
    pub late_nanos: i64,
    /// Time after the stamp of its sweep of a return without time.
    pub offset_nanos: fn(&SweepPoint) -> u32,
}

impl Default for RunOptions {
    fn default() -> Self {
        Self { off_m: [0.0; 2], late_nanos: 0, offset_nanos: |point| point.offset_nanos }
    }
}

/// Known errors: every tenth point of the road is sidewalk.
fn predicted(label: TrueLabel, i: usize) -> u8 {
    if label.class == ClassId::Road as u8 && i.is_multiple_of(10) { ClassId::Sidewalk as u8 } else { label.class }
}

/// Writes the results of a run on a drive with labels into a folder.
pub fn write_run(drive: &Path, run: &Path, options: &RunOptions) -> FinishedRun {
    let drive = Drive::open(drive).expect("opens");
    let labels = drive.true_labels().expect("has labels");
    let truth = drive.true_trajectory().expect("has a trajectory").expect("reads");
    let folder = Folder::new(run);
    folder.keep_only(&[]).expect("made");
    let mut written = FinishedRun::default();
    let mut entries = Vec::new();
    for sweeps in sweeps_of(&drive).chunks(SWEEPS) {
        let submap = Submap::new(sweeps, &truth, &drive.rig().body_from_lidar, options);
        if submap.points.is_empty() {
            continue;
        }
        entries.push(submap.write(entries.len() as u64, sweeps, &labels, &folder, &mut written));
    }
    written.n_submaps = entries.len() as u64;
    let frame = "local east-north-up";
    folder.write_text(INDEX, &Index::new(&entries, frame).to_json()).expect("writes");
    let mut trajectory = Trajectory::default();
    for (stamp, pose) in truth.poses().iter().step_by(10) {
        trajectory.push(*stamp, run_from_truth(options) * pose);
    }
    folder.write_text("trajectory.txt", &tum_from_trajectory(&trajectory)).expect("writes");
    let [latitude_deg, longitude_deg, altitude_m] = drive.manifest().gnss.as_ref().expect("has GNSS").origin;
    let georeference = serde_json::json!({
        "version": 1, "frame": frame, "trajectory_frame": frame,
        "origin": { "latitude_deg": latitude_deg, "longitude_deg": longitude_deg, "altitude_m": altitude_m },
    });
    folder.write_text("georeference.json", &georeference.to_string()).expect("writes");
    written
}

fn run_from_truth(options: &RunOptions) -> Pose {
    Isometry3::translation(options.off_m[0], 0.0, options.off_m[1])
}

fn sweeps_of(drive: &Drive) -> Vec<(SweepInfo, Vec<SweepPoint>)> {
    let mut source = drive.sweeps().expect("opens");
    let mut sweeps = Vec::new();
    loop {
        let mut points = Vec::new();
        let Some(sweep) = source.next_sweep(|found| points.extend_from_slice(found)).expect("reads") else {
            return sweeps;
        };
        sweeps.push((sweep, points));
    }
}

struct Submap {
    header: Box<SubmapHeader>,
    points: Vec<SubmapPoint>,
    /// Sweep and index of the return of each point.
    origins: Vec<(usize, usize)>,
}

impl Submap {
    fn new(
        sweeps: &[(SweepInfo, Vec<SweepPoint>)],
        truth: &Trajectory,
        body_from_lidar: &Pose,
        options: &RunOptions,
    ) -> Self {
        let mut submap = Self { header: Box::default(), points: Vec::new(), origins: Vec::new() };
        for (number, (sweep, returns)) in sweeps.iter().enumerate() {
            let pose_at = |nanos: u32| truth.at(sweep.stamp.plus_nanos(i64::from(nanos)));
            let (Some(begin), Some(end)) = (pose_at(0), pose_at(sweep.duration_nanos)) else { continue };
            let header = &mut submap.header;
            if header.n_sweeps == 0 {
                let odom_from_body = run_from_truth(options) * begin;
                let pose = Pose::from_parts(odom_from_body.translation, heading(&odom_from_body.rotation));
                header.odom_from_submap = pose.into();
                header.stamp_begin = sweep.stamp.0;
            }
            let odom_from_submap = header.odom_from_submap.to_pose().expect("is sound");
            let from_lidar = |body: Pose| odom_from_submap.inverse() * run_from_truth(options) * body * body_from_lidar;
            let begin = from_lidar(begin);
            let end = from_lidar(end);
            let sweep_idx = header.n_sweeps as u16;
            let duration_nanos = sweep.duration_nanos;
            header.stamp_end = sweep.stamp.0 + i64::from(duration_nanos);
            header.sweeps[usize::from(sweep_idx)] = SubmapSweep {
                stamp: sweep.stamp.0 + options.late_nanos,
                seq: sweep.seq,
                duration_nanos,
                submap_from_lidar_begin: pose_numbers(&begin),
                submap_from_lidar_end: pose_numbers(&end),
                ..SubmapSweep::default()
            };
            header.n_sweeps += 1;
            for (i, found) in returns.iter().enumerate() {
                let offset_nanos = (options.offset_nanos)(found);
                let share = f64::from(offset_nanos) / f64::from(duration_nanos);
                let p = interpolate(&begin, &end, share) * Point3::new(found.x, found.y, found.z).cast::<f64>();
                let [x, y, z] = p.coords.map(|value| value as f32).into();
                let SweepPoint { azimuth, intensity, ring, .. } = *found;
                let point =
                    SubmapPoint { x, y, z, offset_nanos, azimuth, intensity, ring, sweep_idx, ..Default::default() };
                submap.points.push(point);
                submap.origins.push((number, i));
            }
        }
        submap
    }

    fn write(
        &self,
        seq: u64,
        sweeps: &[(SweepInfo, Vec<SweepPoint>)],
        labels: &TrueLabels,
        folder: &Folder,
        written: &mut FinishedRun,
    ) -> delivery::CloudEntry {
        let mut classes = Vec::new();
        let mut instances = Vec::new();
        let mut colors = Vec::new();
        for (number, index) in &self.origins {
            let (sweep, returns) = &sweeps[*number];
            let found = &returns[*index];
            let range_m = (found.x * found.x + found.y * found.y + found.z * found.z).sqrt();
            let shot = Shot {
                stamp: sweep.stamp.0 + i64::from(found.offset_nanos),
                ring: found.ring,
                azimuth: Some(found.azimuth),
                range_m: Some(range_m),
            };
            let label = labels.find(&shot).expect("every return has a label");
            let i = written.n_points as usize;
            written.n_points += 1;
            let class_id = predicted(label, i);
            *written.by_class.entry((label.class, class_id)).or_default() += 1;
            // Every fourth point of a pedestrian loses its instance.
            let is_person = label.class == ClassId::Pedestrian as u8 && label.instance != 0;
            let keeps = label.instance != 0 && !(is_person && i.is_multiple_of(4));
            if is_person {
                let [n, n_kept] = written.pedestrians.entry(label.instance).or_default();
                *n += 1;
                *n_kept += u64::from(keeps);
            }
            let is_colored = !i.is_multiple_of(3);
            written.n_colored += u64::from(is_colored);
            classes.push(ClassRow { class_id, score: 255 });
            instances.push(if keeps { u32::from(label.instance) + 1000 } else { 0 });
            colors.push(ColorRow { r: 9, g: 9, b: 9, camera: if is_colored { 2 } else { UNSEEN } });
        }
        let received = ReceivedSubmap {
            seq,
            header: &self.header,
            points: &self.points,
            columns: &[
                ReceivedColumn::new::<ColorTopic>(column("color"), &colors),
                ReceivedColumn::new::<ClassTopic>(column("class"), &classes),
                ReceivedColumn::new::<InstanceTopic>(column("instance"), &instances),
            ],
            spectra: None,
            moving: &[],
            lost: &[],
        };
        let mut entry = write_submap(&received, Kind::Float, folder, None).expect("writes");
        assert_eq!(Stamp(entry.stamp_begin), sweeps[self.origins[0].0].0.stamp);
        entry.sigma_m = Some(SIGMA_M);
        entry.sigma_rad = Some([0.01; 3]);
        entry
    }
}
