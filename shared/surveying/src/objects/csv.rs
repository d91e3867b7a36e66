//! Objects as CSV.

use super::ObjectSummary;
use crate::crs::CrsError;
use crate::target_frame::TargetFrame;
use geometry::OrientedRectangle;
use std::fmt::Write as _;

const NAMES: &str = "id,class,points,clouds,x_m,y_m,z_m,length_m,width_m,height_m,heading_rad,score\n";

/// Objects in the frame of the clouds. `x_m` and `y_m` are the center of the box, `z_m` its lowest height.
pub fn table(summaries: &[ObjectSummary]) -> String {
    let mut text = NAMES.to_owned();
    for summary in summaries {
        let OrientedRectangle { center: [x, y], heading, .. } = summary.footprint;
        push(&mut text, summary, [x, y, summary.low_m], heading);
    }
    text
}

/// Objects in coordinates of a delivery.
pub(super) fn table_in_frame(summaries: &[ObjectSummary], frame: &TargetFrame<'_>) -> Result<String, CrsError> {
    let mut text = NAMES.to_owned();
    for summary in summaries {
        let at = |[x, y]: [f64; 2]| frame.from_cloud([x, y, summary.low_m]);
        let [a, b, ..] = summary.corners();
        let [ax, ay, _] = at(a)?;
        let [bx, by, _] = at(b)?;
        push(&mut text, summary, at(summary.footprint.center)?, (by - ay).atan2(bx - ax));
    }
    Ok(text)
}

fn push(text: &mut String, summary: &ObjectSummary, [x, y, z]: [f64; 3], heading: f64) {
    let ObjectSummary { id, class, n_points, n_clouds, score, footprint, low_m, high_m } = summary;
    let OrientedRectangle { length_m, width_m, .. } = footprint;
    let height_m = high_m - low_m;
    let score = score.map_or_else(String::new, |score| format!("{score:.3}"));
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{id},{class},{n_points},{n_clouds},{x:.2},{y:.2},{z:.2},{length_m:.2},{width_m:.2},{height_m:.2},{heading:.3},{score}"
    );
}
