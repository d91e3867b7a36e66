//! The offset between points and images, over a whole run.

use crate::chunk::seconds;
use crate::cloud::Cloud;
use crate::depth_edges::depth_edges;
use crate::offset::{Look, MAX_AGE_S, Profile};
use crate::offset_fit::{CameraOffset, Offset, fit, fit_at_range};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Profiles that are kept of each camera, at 140 bytes: enough for a tenth of a pixel, and less than a submap's saved state.
const MAX_PROFILES: usize = 1200;

/// Ranges of the table, m: near enough to see a delay, far enough to see none of it.
const RANGES_M: [Range<f32>; 3] = [0.0..8.0, 8.0..20.0, 20.0..120.0];

/// Looks at the outlines of a submap in some exposures, each with its camera's index. Profiles come with theirs.
pub fn look(cloud: &Cloud<'_>, looks: &[(usize, Look<'_>)]) -> Vec<(usize, Vec<Profile>)> {
    let span = |(_, look): &(usize, Look<'_>)| {
        let time = seconds(look.view.stamp, cloud.origin);
        [time - MAX_AGE_S, time + MAX_AGE_S]
    };
    let edges = depth_edges(cloud, &looks.iter().map(span).collect::<Vec<_>>());
    looks.par_iter().map(|(camera, look)| (*camera, look.profiles(cloud, &edges))).collect()
}

/// Profiles gathered submap by submap.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Watch {
    /// By camera.
    profiles: Vec<Vec<Profile>>,
}

impl Watch {
    /// Whether a camera needs no more.
    pub fn has_enough_of(&self, camera: usize) -> bool {
        self.profiles.get(camera).is_some_and(|profiles| profiles.len() >= MAX_PROFILES)
    }

    /// Keeps what was seen.
    pub fn keep(&mut self, found: Vec<(usize, Vec<Profile>)>) {
        for (camera, found) in found {
            if self.profiles.len() <= camera {
                self.profiles.resize(camera + 1, Vec::new());
            }
            self.profiles[camera].extend(found);
            self.profiles[camera].truncate(MAX_PROFILES);
        }
    }

    /// Whether no outline has been looked at.
    pub fn is_empty(&self) -> bool {
        self.profiles.iter().all(Vec::is_empty)
    }

    /// What all profiles together say.
    pub fn offset(&self) -> Offset {
        fit(&self.profiles)
    }

    /// The same for the edges of one range at a time.
    pub fn by_range(&self, camera: usize, offset: &Offset) -> Vec<(Range<f32>, CameraOffset)> {
        let delay_s = offset.delay_s.map_or(0.0, |[delay_s, _]| delay_s);
        let at = |range: Range<f32>| {
            let found = fit_at_range(&self.profiles[camera], range.clone(), &offset.cameras[camera], delay_s);
            (range, found)
        };
        RANGES_M.into_iter().map(at).collect()
    }
}

/// All cameras in one line, `offset in mrad: front 0.4 +- 0.1, left not observable; no delay found`: 270 characters for six names of ten.
pub fn overview(names: &[String], offset: &Offset) -> String {
    let camera = |(index, name): (usize, &String)| match offset.cameras.get(index).filter(|found| found.is_found()) {
        Some(found) => {
            let [angle, sigma] = [found.angle(), found.sigma()].map(|rad| 1e3 * rad);
            format!("{name} {angle:.1} +- {sigma:.1}")
        }
        None => format!("{name} not observable"),
    };
    let cameras: Vec<String> = names.iter().enumerate().map(camera).collect();
    let delay = match offset.delay_s.map(|values| values.map(|seconds| 1e3 * seconds)) {
        Some([delay_ms, deviation_ms]) => format!("delay {delay_ms:.1} +- {deviation_ms:.1} ms"),
        None if offset.tells_delay => "no delay found".to_owned(),
        None => "delay not observable".to_owned(),
    };
    format!("offset in mrad: {}; {delay}", cameras.join(", "))
}

/// All cameras in a second line, `offset by range (0-8, 8-20, 20-120 m) in mrad/px: front 0.4/0.3 0.2/0.1 -`: by range what is known. `px_per_rad`
/// belongs to the names.
pub fn overview_by_range(names: &[String], px_per_rad: &[f32], watch: &Watch, offset: &Offset) -> Option<String> {
    let bin = |(_, found): (Range<f32>, CameraOffset), px_per_rad: f32| {
        let angle = found.angle();
        if found.is_found() { format!("{:.1}/{:.1}", 1e3 * angle, px_per_rad * angle) } else { "-".to_owned() }
    };
    let known = (0..offset.cameras.len()).into_par_iter().filter(|index| offset.cameras[*index].is_found());
    let cameras: Vec<String> = known
        .map(|index| {
            let bins: Vec<String> =
                watch.by_range(index, offset).into_iter().map(|found| bin(found, px_per_rad[index])).collect();
            format!("{} {}", names[index], bins.join(" "))
        })
        .collect();
    let ranges = RANGES_M.map(|range| format!("{:.0}-{:.0}", range.start, range.end)).join(", ");
    (!cameras.is_empty()).then(|| format!("offset by range ({ranges} m) in mrad/px: {}", cameras.join(", ")))
}

/// A camera's offset in words: `name: 3.4 mrad (1.2 px) …`, at most 300 characters.
pub fn sentence(name: &str, px_per_rad: f32, found: &CameraOffset, by_range: &[(Range<f32>, CameraOffset)]) -> String {
    if !found.is_found() {
        return format!("offset of {name}: not observable ({} edges, peak {:.1})", found.n_edges, found.peak);
    }
    let mrad = |rad: f32| 1e3 * rad;
    let ranges: Vec<String> = (by_range.iter().filter(|(_, found)| found.is_found()))
        .map(|(range, found)| format!("{:.0}-{:.0} m {:.1}", range.start, range.end, mrad(found.angle())))
        .collect();
    let [x, y, z] = found.turn.map(mrad);
    let about_axis = if found.is_turned_about_axis {
        format!(", about its axis by {z:.1} +- {:.1}", mrad(found.deviation[2]))
    } else {
        String::new()
    };
    let alone = if found.is_across_alone { " (along the outlines not observable)" } else { "" };
    let sigma = mrad(found.sigma());
    format!(
        "offset of {name}: {:.2} +- {sigma:.2} mrad ({:.2} px); turned about its x by {x:.2} and y by {y:.2}{alone}{about_axis} mrad; by range {}; {} edges, peak {:.0}",
        mrad(found.angle()),
        found.angle() * px_per_rad,
        if ranges.is_empty() { "unknown".to_owned() } else { ranges.join(", ") },
        found.n_edges,
        found.peak
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_cameras_stand_in_one_line() {
        let found = CameraOffset {
            turn: [0.003, 0.004, 0.0],
            is_turned_about_axis: false,
            is_across_alone: false,
            deviation: [0.0003, 0.0004, 0.0],
            n_edges: 900,
            peak: 20.0,
        };
        let lost = CameraOffset { n_edges: 3, ..found.clone() };
        let names = ["front", "left", "back"].map(str::to_owned);
        let offset = Offset { cameras: vec![found, lost], delay_s: Some([0.0284, 0.0004]), tells_delay: true };
        let line = overview(&names, &offset);
        let cameras = "offset in mrad: front 5.0 +- 0.5, left not observable, back not observable";
        assert_eq!(line, format!("{cameras}; delay 28.4 +- 0.4 ms"));
        let offset = Offset { delay_s: None, ..offset };
        assert!(overview(&names, &offset).ends_with("; no delay found"));
        assert!(overview(&names, &Offset { tells_delay: false, ..offset }).ends_with("; delay not observable"));
    }
}
