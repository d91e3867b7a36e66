//! The tables of a survey.

use adjustment::{ControlPoint, MeanResidual, SeenControl, Submaps, Survey, Weighed, disagreement};
use files::csv::csv_cell;
use std::fmt::Write;
use surveying::accuracy::PointResidual;
use surveying::check_points::PointUse;

/// A line for each submap: how far it was moved, m, and its standard deviation.
pub fn submaps(submaps: &Submaps, survey: &Survey) -> String {
    let mut text = "drive,submap,east_m,north_m,up_m,turned_deg,sigma_horizontal_m,sigma_up_m\n".to_owned();
    for (k, submap) in submaps.all.iter().enumerate() {
        let [before, after] = [&survey.before[k], &survey.after[k]];
        let moved = after.translation.vector - before.translation.vector;
        let turned = (after.rotation * before.rotation.inverse()).angle().to_degrees();
        let [horizontal, up] = survey.sigma_m[k];
        let name = csv_cell(&submaps.drives[submap.drive].name);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{name},{},{:.4},{:.4},{:.4},{turned:.4},{horizontal:.4},{up:.4}",
            submap.seq, moved.x, moved.y, moved.z
        );
    }
    text
}

/// A line for each match of two submaps: how far they were apart before and after.
pub fn matches(submaps: &Submaps, survey: &Survey) -> String {
    let mut text = "drive,submap,other_drive,other_submap,agrees,matched_share,rms_m,\
                    before_east_m,before_north_m,before_up_m,after_east_m,after_north_m,after_up_m,\
                    sigma_east_m,sigma_north_m,sigma_up_m\n"
        .to_owned();
    for Weighed { measured, agrees } in &survey.matches {
        let [a, b] = [measured.relative.target, measured.relative.source].map(|k| {
            let submap = &submaps.all[k];
            format!("{},{}", csv_cell(&submaps.drives[submap.drive].name), submap.seq)
        });
        let off = [&survey.before, &survey.after].map(|poses| disagreement(&measured.relative, poses));
        let [before, after] = off.map(|off| format!("{:.4},{:.4},{:.4}", off.x, off.y, off.z));
        let _ = writeln!(
            text,
            "{a},{b},{},{:.3},{:.4},{before},{after},{}",
            u8::from(*agrees),
            measured.matched,
            measured.rms_m,
            measured
                .sigma_m(&survey.after)
                .map_or_else(|| ",,".to_owned(), |sigma| sigma.map(|m| format!("{m:.4}")).join(","))
        );
    }
    text
}

/// A line for each control or check point in each submap that shows it: residuals before and after.
pub fn points(submaps: &Submaps, survey: &Survey, points: &[ControlPoint]) -> String {
    let mut text =
        "name,use,drive,submap,agrees,before_east_m,before_north_m,before_up_m,after_east_m,after_north_m,after_up_m\n"
            .to_owned();
    let control =
        survey.control.iter().map(|Weighed { measured, agrees }| (measured, "control", u8::from(*agrees).to_string()));
    let check = survey.check.iter().map(|seen| (seen, "check", String::new()));
    for (seen, point_use, agrees) in control.chain(check) {
        let submap = &submaps.all[seen.submap];
        let name = csv_cell(&points[seen.point].point.name);
        let drive = csv_cell(&submaps.drives[submap.drive].name);
        let [before, after] = [&survey.before, &survey.after].map(|poses| residual(seen, poses));
        let _ = writeln!(text, "{name},{point_use},{drive},{},{agrees},{before},{after}", submap.seq);
    }
    text
}

/// A line for each control or check point: mean residual after the adjustment over the submaps that show it.
pub fn residuals(means: &[MeanResidual]) -> String {
    let mut text = "name,use,agrees,submaps,east_m,north_m,up_m\n".to_owned();
    for MeanResidual { residual, n_submaps, agrees } in means {
        let PointResidual { name, point_use, east_north_m, up_m, .. } = residual;
        let agrees = if *point_use == PointUse::Control { u8::from(*agrees).to_string() } else { String::new() };
        let [east, north] = east_north_m.map_or([None; 2], |both| both.map(Some));
        let off = [east, north, *up_m].map(metres).join(",");
        let _ = writeln!(text, "{},{},{agrees},{n_submaps},{off}", csv_cell(name), point_use.name());
    }
    text
}

fn residual(seen: &SeenControl, poses: &[geometry::Pose]) -> String {
    seen.residual_m(poses).map(metres).join(",")
}

/// A value as text; empty if unknown.
fn metres(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!("{value:.4}"))
}
