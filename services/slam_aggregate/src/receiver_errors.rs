//! What the errors of a receiver's fixes tell of themselves once the submaps lie in place.

use crate::fixes::Settled;
use geometry::{Pose, Vector3};
use pose_graph::Position;

/// Drifts against the odometry are taken over this time on either side, ns, and up to the next fix at least.
const DRIFT_NANOS: i64 = 2_000_000_000;
/// A receiver's noise and the odometry's drift as much as this, m/s.
const FREE_DRIFT_MPS: f64 = 0.05;
/// A fix that drifts is on its way to or from a wrong place: each such drift beyond the free one adds its deviation once, m/s.
const DOUBTED_DRIFT_MPS: f64 = 0.03;
/// What drifts faster is as wrong as what drifts so fast, m/s: a jump spoils its neighbors, too.
const MOST_DRIFT_MPS: f64 = 1.0;
/// A receiver's filter follows the measured speed, and new positions pull by this share a second at a dilution of 1, less at a
/// worse one. 0.12 to 0.17 do equally well over the fixes of seeds 21 to 34.
const PULL: f64 = 0.14;
/// Error of the measured speed at a dilution of 1, m/s. It goes into the filter, too, and comes out as many times as a change counts.
const SPEED_MPS: f64 = 0.03;
/// A change counts so often at most that no more than this comes out of the speed's error, m: as much as houses do. From a dilution
/// of 3 on some of what the filter keeps is left in.
const MOST_NOISE_M: f64 = 2.0;
/// Steps from fix to fix of a receiver that smooths are shorter than this share of the errors.
const SMOOTH: f64 = 0.5;
/// The steps of a receiver that smooths turn back no more often than in this share: a filter's do in half, those of noise upon an
/// error that stays in 0.7.
const TO_AND_FRO: f64 = 0.6;
/// The told deviations of what a filter keeps hold up to this dilution.
const HOLDING_HDOP: f64 = 2.0;

/// Makes more of the positions, now that it is known where the submaps lie, `world_from_submap` by number. What a smoothing
/// receiver keeps of the fix before is taken out of places by code, which are then known the worse the more the speed's errors count
/// in them; heights, and other places, are doubted as far as they drift.
pub fn unsmooth_or_doubt(settled: &[Settled], positions: &mut [Position], world_from_submap: &[Pose]) {
    let off = |p: &Position| p.p_in_world - world_from_submap[p.submap] * p.p_in_submap;
    let stamps = settled.iter().map(|fix| fix.stamp);
    let offs: Vec<(i64, Vector3<f64>)> = stamps.zip(positions.iter().map(off)).collect();
    let is_smoothed = is_smoothed(&offs);
    for (number, position) in positions.iter_mut().enumerate() {
        let factor = 1.0 + (drift_mps(&offs, number).min(MOST_DRIFT_MPS) - FREE_DRIFT_MPS).max(0.0) / DOUBTED_DRIFT_MPS;
        let [east, north, down] = &mut position.sigma_m;
        *down *= factor;
        position.sigma_above_m *= factor;
        if !is_smoothed || settled[number].by_carrier {
            *east *= factor;
            *north *= factor;
        } else if let Some(before) = number.checked_sub(1).filter(|before| !settled[*before].by_carrier) {
            let seconds = (offs[number].0 - offs[before].0) as f64 * 1e-9;
            let kept = (-seconds * PULL / settled[number].hdop).exp();
            let times = (kept / (1.0 - kept)).min(MOST_NOISE_M / (SPEED_MPS * settled[number].hdop));
            let onward = (offs[number].1 - offs[before].1) * times;
            position.p_in_world.x += onward.x;
            position.p_in_world.y += onward.y;
            // A change counts about as many times as the dilution over the pull.
            let noise = (times * seconds * PULL / HOLDING_HDOP).max(1.0);
            *east *= noise;
            *north *= noise;
        }
    }
}

/// How fast a fix moves against the submaps, m/s. One that is the only one is measured against itself.
fn drift_mps(offs: &[(i64, Vector3<f64>)], number: usize) -> f64 {
    let stamp = offs[number].0;
    let n_before = offs.partition_point(|(at, _)| *at < stamp - DRIFT_NANOS);
    let n_until = offs.partition_point(|(at, _)| *at <= stamp + DRIFT_NANOS);
    let (begin, before) = offs[n_before.min(number.saturating_sub(1))];
    let (end, after) = offs[n_until.max(number + 2).min(offs.len()) - 1];
    (after - before).norm() / ((end - begin) as f64 * 1e-9).max(1e-3)
}

/// Whether a receiver's errors go on from fix to fix. Without a filter steps are 1.4 times as long as the errors themselves; the
/// simulated receiver's are 0.15 to 0.2 times. An error that changes slowly has short steps, too, but those of the noise upon it
/// turn back.
fn is_smoothed(offs: &[(i64, Vector3<f64>)]) -> bool {
    let middle = [0, 1].map(|axis| median(offs.iter().map(|(_, off)| off[axis])));
    let errors = offs.iter().map(|(_, off)| (off.x - middle[0]).hypot(off.y - middle[1]));
    let steps: Vec<_> = offs.windows(2).map(|pair| (pair[1].1 - pair[0].1).xy()).collect();
    let n_turns = steps.windows(2).filter(|pair| pair[0].dot(&pair[1]) < 0.0).count();
    let is_to_and_fro = n_turns as f64 > TO_AND_FRO * (steps.len() as f64 - 1.0);
    median(steps.iter().map(nalgebra::Matrix::norm)) < SMOOTH * median(errors) && !is_to_and_fro
}

/// 0 without values.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Isometry3, Point3};

    const SECOND: i64 = 1_000_000_000;

    /// The fixes refined whose errors to the east are these, by second, on a straight way, at a dilution of 1.
    fn refined(fixes: &[(i64, f64)]) -> Vec<Position> {
        refined_of(fixes, 1.0, false)
    }

    fn refined_of(fixes: &[(i64, f64)], hdop: f64, by_carrier: bool) -> Vec<Position> {
        let at = |second: i64| Point3::new(8.0 * second as f64, 0.0, 1.8);
        let position = |(second, error): &(i64, f64)| Position {
            submap: 0,
            p_in_submap: at(*second),
            p_in_world: world_from_submap() * at(*second) + Vector3::x() * *error,
            sigma_m: [0.2 * hdop, 0.2 * hdop, 0.4 * hdop],
            sigma_above_m: 2.4 * hdop,
            share: 1.0,
        };
        let mut positions: Vec<Position> = fixes.iter().map(position).collect();
        let settled = |(second, _): &(i64, f64)| Settled {
            stamp: second * SECOND,
            hdop,
            by_carrier,
            antenna_in_odom: at(*second),
        };
        let settled: Vec<Settled> = fixes.iter().map(settled).collect();
        unsmooth_or_doubt(&settled, &mut positions, &[world_from_submap()]);
        assert!(positions.iter().all(|p| (p.sigma_above_m / p.sigma_m[2] - 6.0).abs() < 1e-9));
        positions
    }

    fn world_from_submap() -> Pose {
        Isometry3::translation(100.0, 50.0, 3.0)
    }

    /// Factors by which the deviations of their heights rise.
    fn doubts(fixes: &[(i64, f64)]) -> Vec<f64> {
        refined(fixes).iter().map(|p| p.sigma_m[2] / 0.4).collect()
    }

    /// Errors to the east that are left.
    fn errors(fixes: &[(i64, f64)]) -> Vec<f64> {
        refined(fixes).iter().map(error).collect()
    }

    fn error(p: &Position) -> f64 {
        (p.p_in_world - world_from_submap() * p.p_in_submap).x
    }

    /// Normal to a good approximation, by number: a sum of twelve uniforms (splitmix64).
    fn gauss(number: i64) -> f64 {
        let uniform = |part: i64| {
            let mut z = ((number * 12 + part) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(uniform).sum::<f64>() - 6.0
    }

    fn rms(values: impl Iterator<Item = f64>) -> f64 {
        let squares: Vec<f64> = values.map(|value| value * value).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }

    #[test]
    fn what_a_filter_keeps_is_taken_out() {
        // New positions are right, and 8 m off for 40 of 140 seconds; the filter follows within half a minute each time.
        let wrong = |second: i64| if (40..80).contains(&second) { 8.0 } else { 0.0 };
        let mut filtered = 0.0;
        let follow = |second: i64| {
            filtered += (1.0 - (-PULL).exp()) * (wrong(second) - filtered);
            (second, filtered)
        };
        let fixes: Vec<(i64, f64)> = (0..140).map(follow).collect();
        assert!(fixes[90].1 > 1.5, "ten seconds after");
        for ((second, _), error) in fixes.iter().zip(errors(&fixes)) {
            assert!((error - wrong(*second)).abs() < 1e-9, "{second} s: {error} m");
        }
        assert!(refined(&fixes).iter().all(|p| p.sigma_m[..2] == [0.2, 0.2]));
    }

    #[test]
    fn a_filter_of_another_pull_and_noise_leave_more_but_less_than_the_filter_does() {
        let wrong = |second: i64| if (40..80).contains(&second) { 8.0 } else { 0.0 };
        let noise = |second: i64| ((second * 7919 % 13) as f64 - 6.0) * 0.01;
        for pull in [0.10, 0.20] {
            let mut filtered = 0.0;
            let follow = |second: i64| {
                filtered += (1.0 - f64::exp(-pull)) * (wrong(second) - filtered);
                (second, filtered + noise(second))
            };
            let fixes: Vec<(i64, f64)> = (0..140).map(follow).collect();
            let rms = |errors: &[f64]| {
                let off = errors.iter().zip(&fixes).map(|(error, (second, _))| (error - wrong(*second)).powi(2));
                (off.sum::<f64>() / errors.len() as f64).sqrt()
            };
            let before: Vec<f64> = fixes.iter().map(|(_, error)| *error).collect();
            let (before, after) = (rms(&before), rms(&errors(&fixes)));
            assert!(after < 0.6 * before, "pull {pull}: {after} m instead of {before}");
        }
    }

    /// At a dilution of 8 a change once counted 57 times, and the speed's errors came out as 14 m from fixes said to be known
    /// within 1.6 m.
    #[test]
    fn where_the_filter_hardly_follows_the_speed_counts_and_the_places_are_doubted() {
        for hdop in [1.0, 2.0, 4.0, 8.0, 20.0] {
            // New positions are right, and the speed errs by 3 cm/s times the dilution.
            let mut filtered = 0.0;
            let follow = |second: i64| {
                filtered = (-PULL / hdop).exp() * (filtered + SPEED_MPS * hdop * gauss(second));
                (second, filtered)
            };
            let fixes: Vec<(i64, f64)> = (0..300).map(follow).collect();
            let refined = refined_of(&fixes, hdop, false);
            let (before, after) = (rms(fixes.iter().map(|fix| fix.1)), rms(refined.iter().map(error)));
            let deviations = rms(refined.iter().map(|p| error(p) / p.sigma_m[0]));
            println!("dilution {hdop}: {before:.2} m, {after:.2} m, {deviations:.2} deviations");
            assert!(deviations < 2.5, "dilution {hdop}: {deviations}");
            assert!(after < 1.1 * before.hypot(MOST_NOISE_M), "dilution {hdop}: {after} m");
        }
    }

    /// 5 cm that come and go within a minute have short steps, as a filter's output has.
    #[test]
    fn carrier_phases_are_not_filtered_whatever_their_errors_look_like() {
        let fixes: Vec<(i64, f64)> = (0..140).map(|second| (second, 0.05 * (second as f64 * 0.1).sin())).collect();
        let refined = refined_of(&fixes, 1.0, true);
        for ((_, before), after) in fixes.iter().zip(refined.iter().map(error)) {
            assert!((before - after).abs() < 1e-9);
        }
    }

    #[test]
    fn noise_upon_an_error_that_changes_slowly_is_no_filters() {
        for number in 0..20 {
            // 1.5 m that come and go within five minutes, and noise whose steps are a tenth of that.
            let slow = |second: i64| 1.5 * (second as f64 * 0.02 + number as f64).sin();
            let noisy = |second: i64| (second, slow(second) + 0.1 * gauss(second + 1000 * number));
            let fixes: Vec<(i64, f64)> = (0..300).map(noisy).collect();
            let (before, after) = (rms(fixes.iter().map(|fix| fix.1)), rms(errors(&fixes).into_iter()));
            assert!(after < 1.001 * before, "{number}: {after} m instead of {before}");
        }
    }

    #[test]
    fn errors_without_memory_are_left_as_they_are() {
        let noise = |second: i64| (second, (second * 7919 % 13) as f64 - 6.0);
        let fixes: Vec<(i64, f64)> = (0..50).map(noise).collect();
        for ((_, before), after) in fixes.iter().zip(errors(&fixes)) {
            assert!((before - after).abs() < 1e-9);
        }
        let doubted = refined(&fixes);
        assert!(doubted.iter().all(|p| (p.sigma_m[0] / 0.2 - p.sigma_m[2] / 0.4).abs() < 1e-9));
        assert!(doubted.iter().any(|p| p.sigma_m[0] > 1.0));
    }

    #[test]
    fn fixes_that_drift_are_doubted_and_those_that_keep_their_error_are_not() {
        // Wandering off from the tenth second on, by 0.35 m/s, to stay 3.5 m off; then without a fix, and one alone.
        let error = |second: i64| 0.35 * (second - 10).clamp(0, 10) as f64;
        let mut fixes: Vec<(i64, f64)> = (0..30).map(|second| (second, error(second))).collect();
        fixes.extend([(60, 3.5), (90, 33.5)]);
        let doubts = doubts(&fixes);
        for steady in (0..=8).chain(22..30) {
            assert!((doubts[steady] - 1.0).abs() < 1e-9, "{steady}: {}", doubts[steady]);
        }
        for (drifting, doubt) in doubts.iter().enumerate().take(19).skip(12) {
            assert!((doubt - 11.0).abs() < 1e-6, "{drifting}: {doubt}");
        }
        assert!(doubts[11] > 5.0 && doubts[11] < 11.0);
        // Half a metre a second over the minute between its neighbors, a metre a second since the last.
        assert!((doubts[30] - 1.0 - (30.0 / 61.0 - 0.05) / 0.03).abs() < 1e-6, "{}", doubts[30]);
        assert!((doubts[31] - 1.0 - 0.95 / 0.03).abs() < 1e-6, "{}", doubts[31]);
    }

    #[test]
    fn a_fix_alone_is_as_good_as_its_receiver() {
        assert_eq!(doubts(&[(5, 2.0)]), [1.0]);
        assert!(doubts(&[]).is_empty());
    }
}
