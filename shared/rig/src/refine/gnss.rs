//! Delay of the GNSS receiver, estimated by comparing its velocities with the LiDAR's.

use super::{Change, Outcome, Refined, delayed, outcome};
use crate::receiver_delay::receiver_delay;
use crate::survey::Survey;
use geometry::{Point3, Stamp};
use registration::GroundVelocity;

pub(super) fn refine(survey: &Survey, refined: &mut Refined) {
    let entry = refined.manifest.gnss.as_mut();
    if entry.is_none() && survey.fixes.is_empty() {
        return;
    }
    let antenna_in_body = Point3::from(entry.as_ref().map_or([0.0; 3], |entry| entry.antenna_in_body));
    let antenna_in_odom = |stamp: Stamp| Some(survey.trajectory.at(stamp)? * antenna_in_body);
    let velocities = survey.fixes.iter().filter_map(|fix| {
        fix.course_deg?;
        GroundVelocity::new(fix.stamp, fix.speed_mps?, fix.course_deg, fix.hdop)
    });
    let unknown = |quantity: &str, text: &str| Change {
        subject: "gnss".to_owned(),
        quantity: quantity.to_owned(),
        difference: 0.0,
        sigma: 0.0,
        unit: "ms",
        outcome: Outcome::NotObservable,
        text: text.to_owned(),
    };
    let change = match receiver_delay(velocities, antenna_in_odom) {
        Err(reason) => unknown("delay", &reason.to_string()),
        Ok(found) => {
            let [difference, sigma] = [found.late_s, found.sigma_s].map(|seconds| seconds * 1e3);
            let (outcome, text) = match (outcome(difference, sigma), entry) {
                (Outcome::Replaced, None) => {
                    (Outcome::ToDo, "from position packets: drive.toml has no [gnss]".to_owned())
                }
                (Outcome::Replaced, Some(entry)) => match delayed(entry.delay_nanos, found.late_s) {
                    None => (Outcome::Kept, "delay_nanos would pass its limit".to_owned()),
                    Some(new) => {
                        let text = format!("delay_nanos {new} instead of {}", entry.delay_nanos);
                        entry.delay_nanos = new;
                        (Outcome::Replaced, text)
                    }
                },
                _ => (Outcome::Kept, String::new()),
            };
            Change { difference, sigma, outcome, ..unknown("delay", &text) }
        }
    };
    refined.changes.push(change);
    refined.changes.push(unknown("position of the antenna", "only the delay is measured"));
}
