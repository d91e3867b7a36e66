//! Residuals of points and height differences between drives after the adjustment.

use crate::control::ControlPoint;
use crate::drives::Submaps;
use crate::ground::Ground;
use crate::survey::{Survey, Weighed};
use geometry::Pose;
use georeference::SurfacePoint;
use rayon::prelude::*;
use surveying::SurveyAccuracy;
use surveying::accuracy::{AccuracyClass, DriveHeights, PointAccuracy, PointResidual};

/// Mean residual of a point over the submaps that show it.
#[derive(Clone, Debug, PartialEq)]
pub struct MeanResidual {
    /// The residual.
    pub residual: PointResidual,
    /// Number of submaps that show it.
    pub n_submaps: usize,
    /// Whether a control point agrees with the other measurements in any submap. Check points always do.
    pub agrees: bool,
}

/// The mean residual of each point that a submap shows, in the order of the points.
pub fn mean_residuals(survey: &Survey, points: &[ControlPoint]) -> Vec<MeanResidual> {
    let control = survey.control.iter().map(|Weighed { measured, agrees }| (measured, *agrees));
    let seen: Vec<_> = control.chain(survey.check.iter().map(|measured| (measured, true))).collect();
    let mean = |(index, ControlPoint { point, .. }): (usize, &ControlPoint)| {
        let seen: Vec<_> = seen.iter().filter(|(seen, _)| seen.point == index).collect();
        let agrees = seen.iter().any(|(_, agrees)| *agrees);
        // Submaps that contradict the others do not count, unless all do.
        let counted = seen.iter().filter(|(_, counts)| *counts == agrees);
        let off: Vec<[Option<f64>; 3]> = counted.map(|(seen, _)| seen.residual_m(&survey.after)).collect();
        let axis = |axis: usize| {
            let values: Vec<f64> = off.iter().filter_map(|off| off[axis]).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let residual = PointResidual {
            name: point.name.clone(),
            point_use: point.point_use,
            east_north_m: axis(0).zip(axis(1)).map(<[f64; 2]>::from),
            up_m: axis(2),
            sigma_m: point.deviation_m(),
        };
        (!off.is_empty()).then_some(MeanResidual { residual, n_submaps: seen.len(), agrees })
    };
    points.iter().enumerate().filter_map(mean).collect()
}

/// How accurate a survey is. Control points that contradict the other measurements do not count: they were not used.
pub fn accuracy(submaps: &Submaps, survey: &Survey, points: &[ControlPoint]) -> SurveyAccuracy {
    let used = mean_residuals(survey, points).into_iter().filter(|mean| mean.agrees);
    let residuals: Vec<PointResidual> = used.map(|mean| mean.residual).collect();
    let points = PointAccuracy::from_residuals(&residuals);
    let heights = drive_heights(submaps, survey, points.check.vertical_class.as_ref());
    SurveyAccuracy { points, residuals, heights }
}

/// Height differences of each two drives with agreeing matches, over the ground of the matched submaps.
fn drive_heights(submaps: &Submaps, survey: &Survey, class: Option<&AccuracyClass>) -> Vec<DriveHeights> {
    let agreeing: Vec<_> = survey.matches.iter().filter(|found| found.agrees).map(|found| &found.measured).collect();
    let ground = |k: usize, pose: &Pose| {
        let surfaces: Vec<SurfacePoint> = submaps.all[k].keyframe.surfaces().collect();
        Ground::new(&surfaces, pose)
    };
    let differences: Vec<Vec<f64>> = agreeing
        .par_iter()
        .map(|found| {
            let [target, source] = [found.relative.target, found.relative.source].map(|k| ground(k, &survey.after[k]));
            target.above(&source)
        })
        .collect();
    let n = submaps.drives.len();
    let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| [a, b]));
    let heights = pairs.filter_map(|[a, b]| {
        let is_pair = |k: &usize| {
            let relative = &agreeing[*k].relative;
            [submaps.all[relative.target].drive, submaps.all[relative.source].drive] == [a, b]
        };
        let together: Vec<f64> =
            (0..agreeing.len()).filter(is_pair).flat_map(|k| differences[k].iter().copied()).collect();
        DriveHeights::new([a, b].map(|drive| submaps.drives[drive].name.clone()), &together, class)
    });
    heights.collect()
}
