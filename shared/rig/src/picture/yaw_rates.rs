//! Yaw rates of inertial unit and LiDAR over time.

use super::{Content, Picture};
use crate::survey::Survey;
use chart::{Axis, COLORS, Chart, Series};
use registration::Velocity;

/// The picture; `None` without an inertial unit.
pub(super) fn picture(survey: &Survey) -> Option<Picture> {
    survey.inertial.as_ref()?;
    let begin = survey.span[0];
    let pairs = survey.poses.windows(2);
    let by_lidar: Vec<[f64; 2]> = pairs
        .map(|pair| {
            let seconds = pair[1].middle.seconds_since(pair[0].middle).max(1e-3);
            let velocity = Velocity::between(&pair[0].odom_from_body, &pair[1].odom_from_body, seconds);
            [pair[0].middle.seconds_since(begin) + 0.5 * seconds, velocity.angular.z]
        })
        .collect();
    // Mean over a tenth of a second, comparable to the sweeps.
    let mut by_unit: Vec<[f64; 2]> = Vec::new();
    let mut rest = &survey.samples[..];
    while let Some(first) = rest.first() {
        let n = rest.partition_point(|sample| sample.stamp < first.stamp + 100_000_000).max(1);
        let mean = rest[..n].iter().map(|sample| sample.angular_rate[2]).sum::<f64>() / n as f64;
        let middle = (first.stamp - begin.0) as f64 * 1e-9 + 0.05;
        by_unit.push([middle, mean]);
        rest = &rest[n..];
    }
    let all = || by_lidar.iter().chain(&by_unit);
    let top = all().map(|point| point[1].abs()).fold(0.02, f64::max);
    let end = all().map(|point| point[0]).fold(1.0, f64::max);
    let series = vec![
        Series::line("LiDAR", COLORS[0], by_lidar.clone()),
        Series::thin_line("inertial unit", COLORS[1], by_unit.clone()),
    ];
    let [x, y] = [Axis::new("s after the first sweep", [0.0, end]), Axis::new("yaw rate, rad/s", [-top, top])];
    Some(Picture {
        file: "yaw_rates.svg".to_owned(),
        caption: "Yaw rate about the z axis of the body: both lines must lie on each other".to_owned(),
        content: Content::Svg(Chart::new("Yaw rate", x, y, series).svg()),
    })
}
