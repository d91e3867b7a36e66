//! The mountings of the secondary LiDARs, from surfaces measured by both LiDARs.

use super::Verdict;
use crate::error::RigError;
use crate::secondary_lidar::SecondaryMounting;
use crate::survey::{Survey, SurveySettings};
use drive::Drive;

/// Limits of the mounting error, which doubles walls 10 m away, rad and m.
const MAX_TURN: f64 = 0.5 * std::f64::consts::PI / 180.0;
const MAX_SHIFT_M: f64 = 0.08;
/// Least share of the features that lie on the surfaces of the first LiDAR.
const MIN_ON_SURFACE: f64 = 0.6;
const NOT_MEASURED: &str =
    "it has no data, hardly any surface in common with the first LiDAR, another clock, or its mounting is far off";

pub(super) fn verdicts(drive: &Drive, survey: &Survey, settings: &SurveySettings) -> Result<Vec<Verdict>, RigError> {
    let mut verdicts = Vec::new();
    for index in 1..drive.lidars().count() {
        let name = drive.manifest().lidar_name(index).into_owned();
        let found = SecondaryMounting::measure(drive, survey, settings, index)?;
        let unknown = || Verdict::unknown("mounting", &name, NOT_MEASURED);
        verdicts.push(found.map_or_else(unknown, |found| verdict(&name, index, &found)));
    }
    Ok(verdicts)
}

fn verdict(name: &str, index: usize, found: &SecondaryMounting) -> Verdict {
    let SecondaryMounting { shift_m, turn, sigmas, n_matches, on_surface, .. } = found;
    let is_right = |i: usize| {
        let (value, limit) = if i < 3 { (shift_m[i], MAX_SHIFT_M) } else { (turn[i - 3], MAX_TURN) };
        !found.is_determined(i) || value.abs() - 3.0 * sigmas[i] <= limit
    };
    let is_within = (0..6).all(is_right) && *on_surface >= MIN_ON_SURFACE;
    let text = |i: usize| {
        let (value, sigma) = if i < 3 {
            (shift_m[i] * 100.0, sigmas[i] * 100.0)
        } else {
            (turn[i - 3].to_degrees(), sigmas[i].to_degrees())
        };
        if found.is_determined(i) { format!("{value:+.2} +- {sigma:.2}") } else { "not determined".to_owned() }
    };
    let list = |from: usize| (from..from + 3).map(text).collect::<Vec<_>>().join(", ");
    let value = format!(
        "against the first LiDAR it is shifted by {} cm (x, y, z of the body) and turned by {} degrees (about its x, y, z); {:.0} % of \
         {n_matches} features are on surfaces of the first LiDAR",
        list(0),
        list(3),
        on_surface * 100.0
    );
    let t = found.body_from_lidar.translation;
    let q = found.body_from_lidar.rotation.coords;
    let advice = format!(
        "set lidar[{index}].body_from_lidar = {{ translation = [{:.3}, {:.3}, {:.3}], rotation = [{:.5}, {:.5}, {:.5}, {:.5}] }}, or \
         refine it by `replica rig calibrate`",
        t.x, t.y, t.z, q.x, q.y, q.z, q.w
    );
    let limit =
        format!("{:.0} cm, {:.1} degrees, {:.0} %", MAX_SHIFT_M * 100.0, MAX_TURN.to_degrees(), MIN_ON_SURFACE * 100.0);
    Verdict::new("mounting", name, is_within, [value, limit, advice])
}
