//! Simulated drives with two LiDARs: an upright HDL-32E in front, a tilted VLP-16 at the rear.

use drive::{Drive, SweepSource};
use geometry::{Point3, Stamp, Trajectory};
use messages::{SubmapTopic, SweepHeader, SweepPoint, SweepTopic, TrajectoryTopic, pod};
use simulation::{DriveSpec, RigSpec, write_drive};
use slam_aggregate::{Settings, SlamAggregate};
use stage::Received;
use stage::testing::{Bench, context};
use std::sync::OnceLock;
use tempfile::TempDir;

const SECONDS: f64 = 5.0;

/// Sweeps of one tick: stamp, header, points.
type Tick = Vec<(i64, SweepHeader, Vec<SweepPoint>)>;

struct Recorded {
    folder: TempDir,
    ticks: Vec<Tick>,
}

fn recorded() -> &'static Recorded {
    static DRIVE: OnceLock<Recorded> = OnceLock::new();
    DRIVE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let rig = RigSpec::built_in("twin").unwrap();
        let path = folder.path().join("drive");
        write_drive(&DriveSpec { rig, ..DriveSpec::urban(4, SECONDS).sparse(2) }, &path, &mut |_| {}).unwrap();
        let ticks = ticks(&Drive::open(&path).unwrap());
        Recorded { folder, ticks }
    })
}

fn ticks(drive: &Drive) -> Vec<Tick> {
    let lidars: Vec<_> = drive.lidars().collect();
    let mut first = drive.sweeps().unwrap();
    let mut rear = SweepSource::open(lidars[1]).unwrap();
    let mut ticks = Vec::new();
    loop {
        let mut rows = Vec::new();
        let mut of_rear = Vec::new();
        let Some(sweep) = first.next_sweep(|piece| rows.extend_from_slice(piece)).unwrap() else { break };
        let window = [sweep.stamp.0, sweep.stamp.0 + i64::from(sweep.duration_nanos)];
        let slice = rear.next_slice(window, |piece| of_rear.extend_from_slice(piece)).unwrap().unwrap();
        let header = |n_rings, lidar| SweepHeader {
            duration_nanos: sweep.duration_nanos,
            lost_packets: 0,
            n_rings,
            has_times: 1,
            lidar,
        };
        if sweep.turn > 0.9 {
            ticks.push(vec![(sweep.stamp.0, header(32, 0), rows), (slice.stamp.unwrap().0, header(16, 1), of_rear)]);
        }
    }
    ticks
}

fn path() -> std::path::PathBuf {
    recorded().folder.path().join("drive")
}

fn settings() -> Settings {
    Settings { motion: Vec::new(), correct: Vec::new(), ..Settings::default() }
}

fn bench() -> Bench<SlamAggregate> {
    Bench::new(&settings(), &context(&path())).unwrap()
}

fn feed<'a>(bench: &mut Bench<SlamAggregate>, ticks: impl IntoIterator<Item = &'a Tick>) {
    for tick in ticks {
        for (stamp, header, rows) in tick {
            bench.send::<SweepTopic>(*stamp, *header, rows.clone());
        }
        bench.tick().unwrap();
    }
}

fn bytes(submaps: &[Received<SubmapTopic>]) -> Vec<Vec<u8>> {
    let of = |submap: &Received<SubmapTopic>| {
        let header = pod::bytes_from_rows(std::slice::from_ref(submap.header()));
        [header, pod::bytes_from_rows(submap.rows())].concat()
    };
    submaps.iter().map(of).collect()
}

fn poses(bench: &mut Bench<SlamAggregate>) -> Vec<Vec<u8>> {
    bench.take::<TrajectoryTopic>().iter().map(|message| pod::bytes_from_rows(message.rows()).to_vec()).collect()
}

fn truth() -> Trajectory {
    Drive::open(&path()).unwrap().true_trajectory().unwrap().unwrap()
}

#[test]
fn points_of_both_lidars_lie_where_they_are_in_the_world() {
    let mut bench = bench();
    feed(&mut bench, &recorded().ticks);
    bench.finish().unwrap();
    let submaps = bench.take::<SubmapTopic>();
    let truth = truth();
    let drive = Drive::open(&path()).unwrap();
    let mountings = [drive.rig().body_from_lidar, drive.rig().body_from_other_lidars[0]];
    let first = truth.at(Stamp(recorded().ticks[0][0].0)).unwrap();
    let mut n = [0_usize; 2];
    let mut sums = [0.0_f64; 2];
    let mut far = [0_usize; 2];
    let mut n_rows = 0;
    for submap in &submaps {
        let header = submap.header();
        assert_eq!((header.n_lidars, header.n_rings, header.n_rings_of_others), (2, 32, [16, 0, 0]));
        let sweeps = header.checked(submap.seq()).unwrap().sweeps;
        let odom_from_submap = header.odom_from_submap.to_pose().unwrap();
        for (index, sweep) in sweeps.iter().enumerate() {
            assert_eq!(sweep.lidar as usize, index % 2);
            let mounting = mountings[sweep.lidar as usize];
            let begin = sweep.submap_from_lidar_begin.map(f64::from);
            let found = odom_from_submap * Point3::new(begin[0], begin[1], begin[2]);
            let expected = first.inverse() * truth.at(Stamp(sweep.stamp)).unwrap() * mounting;
            assert!((found.coords - expected.translation.vector).norm() < 0.15, "{index}: {found} {expected}");
            let points = &submap.rows()[sweep.first_point as usize..][..sweep.n_points as usize];
            assert!(!points.is_empty(), "sweep {index} has points");
            assert!(points.iter().all(|point| usize::from(point.sweep_idx) == index));
            n_rows += points.len();
        }
        for point in submap.rows().iter().step_by(53) {
            let sweep = &sweeps[usize::from(point.sweep_idx)];
            let lidar = sweep.lidar as usize;
            let stamp = Stamp(sweep.stamp).plus_nanos(i64::from(point.offset_nanos));
            // The ray of the shot, by the raw point of its time, ring and azimuth.
            let tick = recorded().ticks.iter().find(|tick| tick[lidar].0 == sweep.stamp).unwrap();
            let raw = tick[lidar].2.iter().find(|raw| {
                (raw.offset_nanos, raw.ring, raw.azimuth) == (point.offset_nanos, point.ring, point.azimuth)
            });
            let raw = raw.unwrap();
            let expected = first.inverse() * truth.at(stamp).unwrap() * mountings[lidar];
            let expected = expected * Point3::new(raw.x, raw.y, raw.z).cast::<f64>();
            let found = odom_from_submap * Point3::new(point.x, point.y, point.z).cast::<f64>();
            let error_m = (found - expected).norm();
            let range_m = f64::from(raw.x.hypot(raw.y).hypot(raw.z));
            (n[lidar], sums[lidar]) = (n[lidar] + 1, sums[lidar] + error_m);
            far[lidar] += usize::from(error_m > 0.1 + 0.005 * range_m);
        }
        assert_eq!(n_rows, submap.rows().len());
        n_rows = 0;
    }
    for lidar in 0..2 {
        let mean = sums[lidar] / n[lidar] as f64;
        assert!(n[lidar] > 500 && mean < 0.06 && far[lidar] * 100 < n[lidar], "LiDAR {lidar}: {n:?} {mean} {far:?}");
    }
}

#[test]
fn second_lidar_does_not_change_the_path() {
    let mut both = bench();
    feed(&mut both, &recorded().ticks);
    both.finish().unwrap();
    let mut alone = bench();
    let first: Vec<Tick> = recorded().ticks.iter().map(|tick| tick[..1].to_vec()).collect();
    feed(&mut alone, &first);
    alone.finish().unwrap();
    assert_eq!(poses(&mut both), poses(&mut alone));
    let n_points = |bench: &mut Bench<SlamAggregate>| -> usize {
        bench.take::<SubmapTopic>().iter().map(|submap| submap.rows().len()).sum()
    };
    let both = n_points(&mut both);
    let alone = n_points(&mut alone);
    assert!(both as f64 > 1.2 * alone as f64, "{both} points, {alone} without the second LiDAR");
}

#[test]
fn restart_between_ticks_gives_the_same_submaps_of_two_lidars() {
    let ticks = &recorded().ticks;
    let mut reference = bench();
    feed(&mut reference, ticks);
    reference.finish().unwrap();
    let reference = bytes(&reference.take::<SubmapTopic>());
    // After the first tick, which waits for the second; and within a submap.
    for cut in [1, 2, 23] {
        let mut bench = bench();
        feed(&mut bench, &ticks[..cut]);
        let mut found = bytes(&bench.take::<SubmapTopic>());
        let mut bench = bench.restarted(&settings(), &context(&path())).unwrap();
        feed(&mut bench, &ticks[cut..]);
        bench.finish().unwrap();
        found.extend(bytes(&bench.take::<SubmapTopic>()));
        assert!(found == reference, "cut at {cut}");
    }
}

#[test]
fn sweep_of_second_lidar_without_one_of_the_first_is_dropped_and_counted() {
    let mut bench = bench();
    let mut ticks = recorded().ticks[..6].to_vec();
    ticks[3].remove(0);
    feed(&mut bench, &ticks);
    bench.finish().unwrap();
    assert_eq!(bench.counter("sweeps_without_first_lidar"), 1);
    let lidars: Vec<u32> = bench
        .take::<SubmapTopic>()
        .iter()
        .flat_map(|submap| {
            submap.header().checked(0).unwrap().sweeps.iter().map(|sweep| sweep.lidar).collect::<Vec<_>>()
        })
        .collect();
    assert_eq!(lidars, [0, 1, 0, 1, 0, 1, 0, 1, 0, 1]);
}
