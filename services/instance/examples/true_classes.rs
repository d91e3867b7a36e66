//! Instances from true classes and true poses: what the method reaches at best, and what each of its settings is worth.
//!
//! ```sh
//! cargo run --release -p instance --example true_classes -- drives/towns 10 101,102,103,104
//! ```
//!
//! Folder of the drives, their length in s, and their seeds; drives that are not there are simulated, with the lidar alone. The
//! scores are those of `replica evaluate instances` over all submaps of a drive together, so an object that changes its
//! number at a border is missed and made up.

use formats::drive::{Drive, TrueLabel, TrueLabels};
use geometry::{Point3, Pose, Stamp, Trajectory, UnitQuaternion, Vector3};
use instance::{InstanceStage, Settings, Thing};
use messages::{
    CLASS_TABLE_VERSION, Class, ClassHeader, ClassId, ClassRow, Instance, Submap, SubmapHeader, SubmapPoint,
};
use scores::{ClassScore, Overlaps, PointLabel};
use simulation::DriveSpec;
use stage::testing::{Bench, context};
use std::path::Path;

/// As the stage `slam_aggregate` closes them.
const SUBMAP_M: f64 = 20.0;
const SUBMAP_NANOS: i64 = 5_000_000_000;
/// Smaller true objects count for nobody: 100 returns of a drive are a car 60 m away.
const MIN_POINTS: u64 = 100;

struct Street {
    header: SubmapHeader,
    points: Vec<SubmapPoint>,
    truth: Vec<TrueLabel>,
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [folder, seconds, seeds] = words.as_slice() else { panic!("usage: true_classes FOLDER SECONDS SEED,SEED...") };
    let seconds: f64 = seconds.parse().expect("seconds");
    let seeds: Vec<u64> = seeds.split(',').map(|seed| seed.parse().expect("a seed")).collect();
    println!("| seed | settings | class | true | found | SM | PQ | SQ | RQ | mIoU |");
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let mut pooled: Vec<Vec<ClassScore>> = Vec::new();
    for seed in seeds {
        let path = Path::new(folder).join(format!("urban_{seed}_{seconds}"));
        if !path.exists() {
            let spec = DriveSpec { cameras: false, mosaics: false, ..DriveSpec::urban(seed, seconds) };
            simulation::write_drive(&spec, &path, &mut |_| {}).expect("simulates");
        }
        let submaps = submaps(&Drive::open(&path).expect("opens"));
        for (variant_idx, (name, settings)) in variants().into_iter().enumerate() {
            let scores = evaluate(&submaps, &settings);
            for score in &scores {
                print(&seed.to_string(), name, score);
            }
            pooled.resize(pooled.len().max(variant_idx + 1), Vec::new());
            pooled[variant_idx].extend(scores);
        }
    }
    for ((name, _), scores) in variants().into_iter().zip(&pooled) {
        for class in [ClassId::Vehicles, ClassId::Pedestrian] {
            let of_class = || scores.iter().filter(|score| score.class == class as u8);
            let all = ClassScore {
                class: class as u8,
                n_true: of_class().map(|score| score.n_true).sum(),
                n_predicted: of_class().map(|score| score.n_predicted).sum(),
                matches: of_class().flat_map(|score| score.matches.clone()).collect(),
            };
            print("all", name, &all);
        }
    }
}

/// The thesis' rules, then one thing more at a time.
fn variants() -> Vec<(&'static str, Settings)> {
    let with = |peak: [f64; 2], join: [f64; 2], settings: Settings| {
        let things = settings.things.iter().enumerate().map(|(i, thing)| Thing {
            peak_m: peak[i],
            join_m: join[i],
            max_length_m: [6.0, 1.2][i],
            ..thing.clone()
        });
        Settings { things: things.collect(), ..settings.clone() }
    };
    let plain = with([0.0, 0.0], [0.0, 0.0], Settings::default());
    let thesis = Settings { apart_s: 0.0, remembered_submaps: 0, ..plain.clone() };
    let remembered = Settings { apart_s: 0.0, ..plain.clone() };
    let timed = Settings { apart_s: 0.6, ..plain };
    vec![
        ("thesis", thesis),
        ("+ ids over borders", remembered),
        ("+ times", timed.clone()),
        ("+ times, peaks", with([0.4, 0.4], [0.0, 0.0], timed.clone())),
        ("+ times, joins", with([0.0, 0.0], [0.8, 0.3], timed.clone())),
        ("+ times, peaks, joins", with([0.4, 0.4], [0.8, 0.3], timed)),
        ("default", Settings::default()),
    ]
}

fn evaluate(submaps: &[Street], settings: &Settings) -> Vec<ClassScore> {
    let mut bench = Bench::<InstanceStage>::new(settings, &context(Path::new("/nowhere"))).expect("builds");
    let mut overlaps = Overlaps::default();
    for submap in submaps {
        let class = |label: &TrueLabel| ClassRow { class_id: label.class, score: 255 };
        bench.send::<Submap>(0, submap.header, submap.points.clone());
        let header = ClassHeader { class_table_version: CLASS_TABLE_VERSION, model_digest: 0 };
        bench.send::<Class>(0, header, submap.truth.iter().map(class).collect());
        bench.tick().expect("steps");
        for column in bench.take::<Instance>() {
            for (&instance, truth) in column.rows().iter().zip(&submap.truth) {
                let predicted = PointLabel { class: truth.class, instance };
                overlaps.add(PointLabel { class: truth.class, instance: truth.instance.into() }, predicted);
            }
        }
    }
    [ClassId::Vehicles, ClassId::Pedestrian]
        .map(|class| overlaps.score(class as u8, ClassId::Unlabeled as u8, MIN_POINTS))
        .into()
}

fn print(seed: &str, name: &str, score: &ClassScore) {
    let percent = [score.sm(), score.pq(), score.sq(), score.rq(), score.miou()].map(|v| format!("{:.1}", 100.0 * v));
    let class = messages::class_name(score.class);
    println!("| {seed} | {name} | {class} | {} | {} | {} |", score.n_true, score.n_predicted, percent.join(" | "));
}

/// The drive's returns by true poses, cut as the stage `slam_aggregate` cuts them.
fn submaps(drive: &Drive) -> Vec<Street> {
    let trajectory = drive.true_trajectory().expect("has a truth").expect("reads");
    let labels = drive.true_labels().expect("has labels");
    let body_from_lidar = drive.rig().body_from_lidar;
    let mut source = drive.sweeps().expect("opens");
    let mut submaps: Vec<Street> = Vec::new();
    let mut begin: Option<(i64, Vector3<f64>)> = None;
    loop {
        let mut returns = Vec::new();
        let Some(sweep) = source.next_sweep(|found| returns.extend_from_slice(found)).expect("reads") else {
            return submaps;
        };
        let Some(pose) = trajectory.at(sweep.stamp) else { continue };
        let place = pose.translation.vector;
        let is_full = begin
            .is_none_or(|(stamp, from)| (place - from).norm() >= SUBMAP_M || sweep.stamp.0 - stamp >= SUBMAP_NANOS);
        if is_full {
            begin = Some((sweep.stamp.0, place));
            submaps.push(Street { header: header(&pose), points: Vec::new(), truth: Vec::new() });
        }
        let Some(submap) = submaps.last_mut() else { continue };
        let sweep_idx = submap.header.n_sweeps as u16;
        submap.header.sweeps[usize::from(sweep_idx)].stamp = sweep.stamp.0;
        submap.header.n_sweeps += 1;
        let submap_from_world = submap.header.world_from_submap.to_pose().expect("is sound").inverse();
        for found in &returns {
            let stamp = Stamp(sweep.stamp.0 + i64::from(found.offset_nanos));
            let Some((point, label)) = place_point(&trajectory, &labels, stamp, found.ring, |world_from_body| {
                submap_from_world * world_from_body * body_from_lidar * Point3::new(found.x, found.y, found.z).cast()
            }) else {
                continue;
            };
            let [x, y, z] = point.coords.map(|v| v as f32).into();
            let (offset_nanos, ring) = (found.offset_nanos, found.ring);
            submap.points.push(SubmapPoint { x, y, z, offset_nanos, ring, sweep_idx, ..SubmapPoint::default() });
            submap.truth.push(label);
        }
    }
}

fn place_point(
    trajectory: &Trajectory,
    labels: &TrueLabels,
    stamp: Stamp,
    ring: u8,
    place: impl FnOnce(Pose) -> Point3<f64>,
) -> Option<(Point3<f64>, TrueLabel)> {
    Some((place(trajectory.at(stamp)?), labels.find(stamp.0, ring)?))
}

/// At the body, turned with it about z.
fn header(world_from_body: &Pose) -> SubmapHeader {
    let forward = world_from_body.rotation * Vector3::x();
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), forward.y.atan2(forward.x));
    let world_from_submap = Pose::from_parts(world_from_body.translation, rotation).into();
    SubmapHeader { world_from_submap, ..SubmapHeader::default() }
}
