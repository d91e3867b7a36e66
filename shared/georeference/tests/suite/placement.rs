//! Georeferencing with the faults of real receivers: result and reports.

use crate::drive::{SECONDS, errors, fix, noise, placed, stated};
use geometry::Vector3;
use messages::{FRAME_EAST_NORTH_UP, GnssRow};

#[test]
fn good_fixes_place_the_drive_and_are_all_used() {
    let placed = placed(|second| Some(fix(second, noise(1, second, 0.1))));
    let [across, up, heading] = errors(&placed);
    assert_eq!(placed.header.frame, FRAME_EAST_NORTH_UP);
    assert!(across < 0.25 && up < 0.15 && heading < 0.15, "{across} m, {up} m, {heading} degrees");
    assert_eq!((placed.fixes.n_used, placed.fixes.delay), (SECONDS as usize, None));
    assert!(!placed.summary.contains("stamps"), "{}", placed.summary);
}

/// Regression: heights were biased low by 1.2 standard deviations.
#[test]
fn white_noise_leaves_heights_unbiased() {
    let mut mean = 0.0;
    let mut squares = 0.0;
    for stream in 0..10 {
        let placed = placed(|second| Some(fix(second, noise(100 + stream, second, 0.97))));
        let [across, up, _] = errors(&placed);
        assert!(across < 0.5 && up < 0.45, "stream {stream}: {across} m, {up} m");
        assert!(stated(&placed)[1] < 1.0, "{:?}", stated(&placed));
        let off = |row: &messages::PlacementRow| row.world_from_submap.to_pose().unwrap().translation.z - 5.0;
        mean += placed.rows.iter().map(off).sum::<f64>() / placed.rows.len() as f64 / 10.0;
        squares += up * up / 10.0;
    }
    assert!(mean.abs() < 0.12 && squares.sqrt() < 0.3, "{mean} m, {} m RMS", squares.sqrt());
}

#[test]
fn fixes_that_err_alike_for_a_third_of_the_drive_are_rejected() {
    let error = |second: i64| if (40..80).contains(&second) { Vector3::new(30.0, 0.0, 0.0) } else { Vector3::zeros() };
    let wrong = placed(|second| Some(fix(second, error(second) + noise(2, second, 0.1))));
    let right = placed(|second| Some(fix(second, noise(2, second, 0.1))));
    let [across, up, heading] = errors(&wrong);
    assert!(across < 0.4 && up < 0.4 && heading < 0.2, "{across} m, {up} m, {heading} degrees");
    let n_rejected = wrong.header.n_fixes_refused;
    assert!((38..=46).contains(&n_rejected), "{n_rejected}");
    assert!(stated(&wrong)[0] > 1.3 * stated(&right)[0], "{:?} {:?}", stated(&wrong), stated(&right));
}

/// Regression: all fixes together rotated the drive towards a drifting minority.
#[test]
fn heading_follows_the_course_while_fixes_drift() {
    // 45 % of the fixes drift away by up to 25 m.
    let error = |second: i64| Vector3::new(-0.3, 0.35, 0.5) * (54.0 - second as f64).max(0.0);
    let placed = placed(|second| Some(fix(second, error(second) + noise(3, second, 0.1))));
    let [across, up, heading] = errors(&placed);
    assert!(across < 0.6 && up < 1.0 && heading < 0.25, "{across} m, {up} m, {heading} degrees");
    assert!(placed.header.n_fixes_refused > 25, "{:?}", placed.header);
}

#[test]
fn late_and_early_stamps_are_estimated_and_corrected() {
    for late_nanos in [200_000_000, -350_000_000] {
        let late = |second: i64| {
            let row = fix(second, noise(4, second, 0.1));
            GnssRow { stamp: row.stamp + late_nanos, ..row }
        };
        let placed = placed(|second| Some(late(second)));
        let delay = placed.fixes.delay.expect("a delay");
        let off = delay.late_s - late_nanos as f64 * 1e-9;
        assert!(off.abs() < 0.02 && delay.sigma_s < 0.02, "{delay:?}");
        let [across, ..] = errors(&placed);
        assert!(across < 0.3, "{across} m");
        let side = if late_nanos > 0 { "late" } else { "early" };
        assert!(placed.summary.contains(&format!("s {side}")), "{}", placed.summary);
    }
}

#[test]
fn delay_beyond_the_estimated_range_is_reported() {
    let late = |second: i64| {
        let row = fix(second, Vector3::zeros());
        GnssRow { stamp: row.stamp + 1_300_000_000, ..row }
    };
    let placed = placed(|second| Some(late(second)));
    assert!(placed.fixes.delay.is_some_and(|delay| delay.is_out_of_range()), "{:?}", placed.fixes);
}

#[test]
fn bursts_of_multipath_do_not_raise_the_drive() {
    // Five bursts; each jumps and then decays for some seconds.
    let burst = |second: i64| {
        let since = (second - 8).rem_euclid(24) as f64;
        Vector3::new(5.0, -3.0, 9.0) * (-since / 5.0).exp()
    };
    let placed = placed(|second| Some(fix(second, burst(second) + noise(5, second, 0.1))));
    let [across, up, _] = errors(&placed);
    let [stated_across, stated_up, _] = stated(&placed);
    assert!(across < 0.5 && up < 0.8, "{across} m, {up} m");
    assert!(across < 2.0 * stated_across && up < 2.0 * stated_up, "{across} m, {up} m: {:?}", stated(&placed));
}

#[test]
fn few_fixes_place_the_drive_with_larger_deviations() {
    let few = placed(|second| (second % 30 == 7).then(|| fix(second, noise(6, second, 0.2))));
    let many = placed(|second| Some(fix(second, noise(6, second, 0.2))));
    assert_eq!((few.header.frame, few.fixes.n), (FRAME_EAST_NORTH_UP, 4));
    assert!(errors(&few)[0] < 0.7, "{:?}", errors(&few));
    assert!(stated(&few)[0] > stated(&many)[0], "{:?} {:?}", stated(&few), stated(&many));
}

#[test]
fn scattered_fixes_are_reported_as_unused_or_with_large_deviations() {
    let error = |second: i64| {
        let angle = second as f64 * 2.4;
        Vector3::new(angle.sin(), angle.cos(), 0.2) * 300.0
    };
    let placed = placed(|second| Some(fix(second, error(second))));
    assert!(placed.fixes.n_used < placed.fixes.n / 4, "{:?}", placed.fixes);
    assert!(placed.header.frame != FRAME_EAST_NORTH_UP || stated(&placed)[0] > 100.0, "{:?}", stated(&placed));
}

#[test]
fn receiver_without_velocities_places_the_drive_despite_a_wrong_third() {
    let error = |second: i64| if second < 40 { Vector3::new(-22.0, 20.0, 0.0) } else { Vector3::zeros() };
    let placed = placed(|second| {
        Some(GnssRow { speed_mps: -1.0, course_deg: -1.0, ..fix(second, error(second) + noise(7, second, 0.1)) })
    });
    let [across, _, heading] = errors(&placed);
    assert!(across < 1.3 && heading < 0.6, "{across} m, {heading} degrees");
}

#[test]
fn deviations_that_a_receiver_states_reach_the_result_unless_they_are_too_small() {
    let with = |across_m: f32, up_m: f32| {
        placed(|second| {
            let row = fix(second, noise(8, second, 0.1));
            Some(GnssRow { deviation_across_m: across_m, deviation_up_m: up_m, ..row })
        })
    };
    let [plain, small, large] = [with(0.0, 0.0), with(0.001, 0.001), with(3.0, 5.0)].map(|placed| stated(&placed));
    assert_eq!(plain, small);
    assert!(large[0] > 3.0 * 2_f64.sqrt() && large[1] > 5.0, "{large:?}");
}
