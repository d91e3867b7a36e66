//! Log lines about offsets.

use crate::monitor::{OffsetMonitor, RANGES_M, RangeOffset};
use crate::offset::{CameraOffset, Offset};
use coloring::ProjectionCamera;
use rayon::prelude::*;

/// Report of a run on the offset between points and images.
#[derive(Default)]
pub struct OffsetReport {
    /// Log lines.
    pub lines: Vec<String>,
    /// Whether the offset exceeds the limit, for each camera with a known offset.
    pub are_large: Vec<bool>,
}

impl OffsetReport {
    /// Creates the report; empty without profiles. `limits`: limit of the offset, rad, and of the delay, s.
    pub fn from_monitor(
        monitor: &OffsetMonitor,
        names: &[String],
        cameras: &[ProjectionCamera],
        limits: [f32; 2],
    ) -> Self {
        if monitor.is_empty() {
            return Self::default();
        }
        let offset = monitor.offset();
        let px_per_rad: Vec<f32> = cameras.iter().map(ProjectionCamera::px_per_rad).collect();
        let known = offset.cameras.iter().filter(|found| found.is_observable());
        let are_large = known.map(|found| found.exceeds(limits[0])).collect();
        Self { lines: lines(monitor, &offset, names, &px_per_rad, limits), are_large }
    }
}

/// The lines of a whole run: an overview of all cameras, the offsets by range, one line for each camera whose offset exceeds
/// `max_offset_rad`, and one for a delay above `max_delay_s`. `px_per_rad` belongs to the names of the cameras.
pub fn lines(
    monitor: &OffsetMonitor,
    offset: &Offset,
    names: &[String],
    px_per_rad: &[f32],
    [max_offset_rad, max_delay_s]: [f32; 2],
) -> Vec<String> {
    let mut lines = vec![overview(names, offset)];
    lines.extend(overview_by_range(names, px_per_rad, monitor, offset));
    for (index, found) in offset.cameras.iter().enumerate().filter(|(_, found)| found.exceeds(max_offset_rad)) {
        lines.push(camera_line(&names[index], px_per_rad[index], found, &monitor.by_range(index, offset)));
    }
    if let Some([delay_s, deviation_s]) =
        offset.delay_s.filter(|[delay_s, sigma_s]| delay_s.abs() - 3.0 * sigma_s > max_delay_s)
    {
        lines.push(format!("images were taken {:.1} +- {:.1} ms after their stamps", 1e3 * delay_s, 1e3 * deviation_s));
    }
    lines
}

/// All cameras in one line: `offset in mrad: front 0.4 +- 0.1, left not observable; no delay found`. 270 characters for six
/// names of ten.
fn overview(names: &[String], offset: &Offset) -> String {
    let camera = |(index, name): (usize, &String)| match offset.cameras.get(index).filter(|found| found.is_observable())
    {
        Some(found) => {
            let [angle, sigma] = [found.angle(), found.sigma()].map(|rad| 1e3 * rad);
            format!("{name} {angle:.1} +- {sigma:.1}")
        }
        None => format!("{name} not observable"),
    };
    let cameras: Vec<String> = names.iter().enumerate().map(camera).collect();
    let delay = match offset.delay_s.map(|values| values.map(|seconds| 1e3 * seconds)) {
        Some([delay_ms, deviation_ms]) => format!("delay {delay_ms:.1} +- {deviation_ms:.1} ms"),
        None if offset.is_delay_observable => "no delay found".to_owned(),
        None => "delay not observable".to_owned(),
    };
    format!("offset in mrad: {}; {delay}", cameras.join(", "))
}

/// All cameras by range in one line: `offset by range (0-8, 8-20, 20-120 m) in mrad/px: front 0.4/0.3 0.2/0.1 -`, with `-` where
/// the offset is not observable.
fn overview_by_range(names: &[String], px_per_rad: &[f32], monitor: &OffsetMonitor, offset: &Offset) -> Option<String> {
    let bin = |found: &CameraOffset, px_per_rad: f32| {
        let angle = found.angle();
        if found.is_observable() { format!("{:.1}/{:.1}", 1e3 * angle, px_per_rad * angle) } else { "-".to_owned() }
    };
    let known = (0..offset.cameras.len()).into_par_iter().filter(|index| offset.cameras[*index].is_observable());
    let cameras: Vec<String> = known
        .map(|index| {
            let bins: Vec<String> =
                monitor.by_range(index, offset).iter().map(|found| bin(&found.offset, px_per_rad[index])).collect();
            format!("{} {}", names[index], bins.join(" "))
        })
        .collect();
    let ranges = RANGES_M.map(|range| format!("{:.0}-{:.0}", range.start, range.end)).join(", ");
    (!cameras.is_empty()).then(|| format!("offset by range ({ranges} m) in mrad/px: {}", cameras.join(", ")))
}

/// The offset of one camera in detail, at most 300 characters.
pub fn camera_line(name: &str, px_per_rad: f32, found: &CameraOffset, by_range: &[RangeOffset]) -> String {
    if !found.is_observable() {
        return format!("offset of {name}: not observable ({} edges, peak {:.1})", found.n_edges, found.peak);
    }
    let mrad = |rad: f32| 1e3 * rad;
    let ranges: Vec<String> = (by_range.iter().filter(|found| found.offset.is_observable()))
        .map(|RangeOffset { range_m, offset }| {
            format!("{:.0}-{:.0} m {:.1}", range_m.start, range_m.end, mrad(offset.angle()))
        })
        .collect();
    let [x, y, z] = found.rotation.map(mrad);
    let about_axis = if found.is_rotated_about_axis {
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
    fn overview_lists_all_cameras_and_delay() {
        let found = CameraOffset {
            rotation: [0.003, 0.004, 0.0],
            is_rotated_about_axis: false,
            is_across_alone: false,
            deviation: [0.0003, 0.0004, 0.0],
            n_edges: 900,
            peak: 20.0,
        };
        let lost = CameraOffset { n_edges: 3, ..found.clone() };
        let names = ["front", "left", "back"].map(str::to_owned);
        let offset = Offset { cameras: vec![found, lost], delay_s: Some([0.0284, 0.0004]), is_delay_observable: true };
        let line = overview(&names, &offset);
        let cameras = "offset in mrad: front 5.0 +- 0.5, left not observable, back not observable";
        assert_eq!(line, format!("{cameras}; delay 28.4 +- 0.4 ms"));
        let offset = Offset { delay_s: None, ..offset };
        assert!(overview(&names, &offset).ends_with("; no delay found"));
        assert!(overview(&names, &Offset { is_delay_observable: false, ..offset }).ends_with("; delay not observable"));
    }
}
