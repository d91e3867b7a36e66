//! Placement of a recorded drive by its recorded fixes.

use crate::kitti_drive::{FIXES, KittiDrive, POSES, SAMPLES, settings};
use crate::scored::{SWEEP_NANOS, Score, ScoredDrive};
use geometry::Pose;

/// Fixes by carrier phases: they agree with the reference poses within centimetres.
const QUALITY: u32 = 4;

/// The drive cut into parts of this many seconds, each placed by the fixes of its first `fix_seconds`.
fn scores(seconds: i64, fix_seconds: i64) -> Vec<Score> {
    let drive = KittiDrive::read([POSES, FIXES, SAMPLES].map(real_data::path).each_ref().map(|path| &**path), QUALITY);
    let [first, last] = drive.span();
    let n_sweeps = seconds * 1_000_000_000 / SWEEP_NANOS;
    let n_parts = (last - first) / (n_sweeps * SWEEP_NANOS);
    let part = |number: i64| {
        let begin = first + number * n_sweeps * SWEEP_NANOS;
        let truth = |nanos: i64| -> Pose { drive.truth_at(begin + nanos) };
        let KittiDrive { fixes, samples, .. } = &drive;
        let fixes = &fixes[..fixes.partition_point(|fix| fix.stamp - begin < fix_seconds * 1_000_000_000)];
        ScoredDrive { truth: &truth, begin, n_sweeps, fixes, samples, seed: 4000 + number as u64 }.place(&settings())
    };
    (0..n_parts).map(|number| part(number).expect("is placed")).collect()
}

fn mean(scores: &[Score], of: impl Fn(&Score) -> f64) -> f64 {
    scores.iter().map(of).sum::<f64>() / scores.len() as f64
}

#[real_data::test(
    "gnss_drives/kitti_2011_10_03_0027/poses_00.txt.gz",
    "gnss_drives/kitti_2011_10_03_0027/KittiGps_converted.txt",
    "gnss_drives/kitti_2011_10_03_0027/KittiEquivBiasedImu.txt.gz"
)]
fn recorded_fixes_place_a_city_drive_with_covering_deviations() {
    let whole = scores(470, 470);
    let minutes = scores(60, 60);
    assert_eq!((whole.len(), minutes.len()), (1, 7));
    whole.iter().chain(&minutes).for_each(|score| println!("{score}"));
    for score in whole.iter().chain(&minutes) {
        let [across, up, heading] = score.rms;
        assert!(across < 0.3 && up < 0.3 && heading < 0.5, "{score}");
    }
    for axes in 0..2 {
        let normalized = mean(&minutes, |score| score.normalized[axes]);
        assert!(normalized < 2.0, "{axes}: {normalized}");
    }
}

/// Odometry of 3 km after the last fix: the odometry causes the errors of position, height and heading.
#[real_data::test(
    "gnss_drives/kitti_2011_10_03_0027/poses_00.txt.gz",
    "gnss_drives/kitti_2011_10_03_0027/KittiGps_converted.txt",
    "gnss_drives/kitti_2011_10_03_0027/KittiEquivBiasedImu.txt.gz"
)]
fn fixes_at_the_start_of_a_city_drive_leave_errors_within_three_deviations() {
    let scores = [scores(470, 60), scores(180, 30)].concat();
    assert_eq!(scores.len(), 3);
    for score in &scores {
        println!("{score}");
        let [across, up, heading] = [0, 1, 2].map(|k| score.rms[k] / score.stated[k]);
        assert!(across < 3.0 && up < 3.0 && heading < 3.0, "{score}");
    }
}
