//! Residuals of the cloud against check points that were measured independently.

mod file;
mod map;
mod picked;
mod plane;
mod report;

pub use file::{CheckPoint, PointUse, check_points_from_csv, load_check_points};

use crate::accuracy::{PointAccuracy, PointResidual, accuracy_table};
use crate::cloud::{self, Cloud};
use crate::error::DeliverError;
use crate::run_folder::RunFolder;
use crate::target_frame::TargetFrame;
use files::atomic_file::write_atomic;
use picked::Picked;
use plane::PlaneSums;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;

/// Points of the cloud within this horizontal distance of a check point give its surface, m.
const RADIUS_M: f64 = 0.5;
/// Largest height difference of these points, m: a car or a tree over the check point is not its surface.
const MAX_HEIGHT_M: f64 = 0.5;
/// Least number of points of the cloud for a surface.
const MIN_POINTS: u64 = 10;
/// Points that are converted with one converter.
const PART_POINTS: usize = 1 << 14;

/// A check point with the residuals of the cloud, cloud minus check point, m.
#[derive(Clone, Debug, PartialEq)]
pub struct Residual {
    /// The check point.
    pub point: CheckPoint,
    /// East and north; `None` unless the file gives the position of the point in the cloud.
    pub horizontal_m: Option<[f64; 2]>,
    /// Up; `None` with too few points of the cloud.
    pub up_m: Option<f64>,
    /// Number of points of the cloud that gave the surface.
    pub n_points: u64,
    /// Standard deviation of these points from their plane, m.
    pub roughness_m: Option<f64>,
}

/// The comparison of a cloud with check points.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Accuracy over the control points and over the check points.
    pub accuracy: PointAccuracy,
    /// Residuals of each point.
    pub residuals: Vec<Residual>,
}

impl Comparison {
    /// The check points without points of the cloud near them.
    pub fn outside(&self) -> impl Iterator<Item = &CheckPoint> {
        self.residuals.iter().filter(|residual| residual.n_points == 0).map(|residual| &residual.point)
    }

    /// Why no check point says anything about the cloud: all lie outside of it, or none has a residual. `cloud` are the smallest
    /// and largest coordinates of the cloud. `None` if at least one check point is usable.
    pub fn unusable(&self, cloud: [[f64; 3]; 2]) -> Option<String> {
        let n = self.residuals.len();
        let has_residual = |residual: &Residual| residual.up_m.is_some() || residual.horizontal_m.is_some();
        if self.residuals.iter().any(|residual| residual.n_points > 0) {
            return (!self.residuals.iter().any(has_residual)).then(|| {
                format!(
                    "none of {n} check points has a residual: a plane needs {MIN_POINTS} points of the cloud within {RADIUS_M} m, \
                     the most are {}",
                    self.residuals.iter().map(|residual| residual.n_points).max().unwrap_or_default()
                )
            });
        }
        let points = bounds(self.residuals.iter().map(|residual| residual.point.xyz))?;
        let is_in = |from: usize, to: usize| cloud[0][to] <= points[1][from] && points[0][from] <= cloud[1][to];
        let hint = if is_in(0, 0) && is_in(1, 1) && !is_in(2, 2) {
            "heights of the table and of the delivery refer to different surfaces; see --geoid"
        } else if is_in(0, 1) && is_in(1, 0) && !(is_in(0, 0) && is_in(1, 1)) {
            "x and y of the table are swapped; x is the easting, y the northing"
        } else {
            "write the table in the coordinates of the delivery, or choose the system of the table with --crs"
        };
        Some(format!(
            "none of {n} check points lies in the cloud, so nothing is known about its accuracy: the check points have {}; the \
             cloud has {}; a check point needs points of the cloud within {RADIUS_M} m and within {MAX_HEIGHT_M} m of height\n\
             hint: {hint}",
            range_text(points),
            range_text(cloud)
        ))
    }
}

/// Smallest and largest coordinates. `None` without points.
fn bounds(points: impl Iterator<Item = [f64; 3]>) -> Option<[[f64; 3]; 2]> {
    points.map(|xyz| [xyz; 2]).reduce(|[low, high], [a, b]| {
        [std::array::from_fn(|axis| low[axis].min(a[axis])), std::array::from_fn(|axis| high[axis].max(b[axis]))]
    })
}

fn range_text([low, high]: [[f64; 3]; 2]) -> String {
    let axes = ["x", "y", "z"].iter().enumerate();
    let ranges: Vec<String> =
        axes.map(|(axis, name)| format!("{name} {:.2} to {:.2}", low[axis], high[axis])).collect();
    ranges.join(", ")
}

/// Compares the cloud with check points. Writes `check_points.csv`, `check_points_summary.csv` and the map
/// `check_points.svg` into the existing folder `out`.
pub fn write_check_points(
    runs: &[RunFolder],
    frame: &TargetFrame<'_>,
    points: Vec<CheckPoint>,
    out: &Path,
) -> Result<Comparison, DeliverError> {
    let mut picked = Picked::new(runs, &points)?;
    let sums = surfaces(runs, frame, &points, &mut picked)?;
    let picked = picked.positions(frame, &points)?;
    let points = points.into_iter().zip(sums).zip(picked);
    let residuals: Vec<Residual> = points.map(|((point, sums), picked)| residual(point, &sums, picked)).collect();
    let accuracy = PointAccuracy::from_residuals(&residuals.iter().map(PointResidual::from).collect::<Vec<_>>());
    let poses = runs.iter().flat_map(|run| run.trajectory.poses());
    let path = poses.map(|(_, pose)| frame.from_local(&pose.translation.vector.into()).map(|[x, y, _]| [x, y]));
    let path: Vec<[f64; 2]> = path.collect::<Result<_, _>>()?;
    for (name, text) in [
        ("check_points.csv", report::table(&residuals)),
        ("check_points_summary.csv", accuracy_table(&accuracy)),
        ("check_points.svg", map::map(&residuals, path)),
    ] {
        let path = out.join(name);
        write_atomic(&path, text.as_bytes()).map_err(DeliverError::file(&path, "write"))?;
    }
    Ok(Comparison { accuracy, residuals })
}

fn residual(point: CheckPoint, sums: &PlaneSums, picked: Option<[f64; 3]>) -> Residual {
    let surface = sums.plane().filter(|_| sums.n_points() >= MIN_POINTS);
    let (horizontal_m, up_m) = match picked {
        Some(found) => {
            let [x, y, z] = std::array::from_fn(|axis| found[axis] - point.xyz[axis]);
            (Some([x, y]), Some(z))
        }
        None => (None, surface.filter(|_| point.in_cloud.is_none()).map(|(height, _)| height)),
    };
    let roughness_m = surface.map(|(_, deviation)| deviation);
    Residual { point, horizontal_m, up_m, n_points: sums.n_points(), roughness_m }
}

impl From<&Residual> for PointResidual {
    fn from(Residual { point, horizontal_m, up_m, .. }: &Residual) -> Self {
        Self {
            name: point.name.clone(),
            point_use: point.point_use,
            east_north_m: *horizontal_m,
            up_m: *up_m,
            sigma_m: point.deviation_m(),
        }
    }
}

/// The points of the cloud around each check point, relative to it. Points on moving objects are left out.
fn surfaces(
    runs: &[RunFolder],
    frame: &TargetFrame<'_>,
    points: &[CheckPoint],
    picked: &mut Picked,
) -> Result<Vec<PlaneSums>, DeliverError> {
    let cell = |value: f64| (value / RADIUS_M).floor() as i64;
    // Each check point is entered in its own cell and the cells around it.
    let mut near: BTreeMap<(i64, i64), Vec<usize>> = BTreeMap::new();
    for (k, CheckPoint { xyz: [x, y, _], .. }) in points.iter().enumerate() {
        for (i, j) in (-1..=1).flat_map(|i| (-1..=1).map(move |j| (i, j))) {
            near.entry((cell(*x) + i, cell(*y) + j)).or_default().push(k);
        }
    }
    let find = |cloud: &Cloud<'_>, rows: &[u8]| -> Result<Vec<(usize, [f64; 3])>, DeliverError> {
        let mut converter = frame.converter();
        let mut found = Vec::new();
        for row in rows.chunks_exact(cloud.columns.row_size()) {
            let point = cloud.columns.point(row);
            if point.is_moving || point.xyz.iter().any(|value| !value.is_finite()) {
                continue;
            }
            let xyz = converter.convert(point.xyz)?;
            for k in near.get(&(cell(xyz[0]), cell(xyz[1]))).into_iter().flatten() {
                let off: [f64; 3] = std::array::from_fn(|axis| xyz[axis] - points[*k].xyz[axis]);
                if off[0].hypot(off[1]) <= RADIUS_M && off[2].abs() <= MAX_HEIGHT_M {
                    found.push((*k, off));
                }
            }
        }
        Ok(found)
    };
    let mut sums = vec![PlaneSums::default(); points.len()];
    let clouds = cloud::open_all(runs)?.clouds;
    for cloud in &clouds {
        picked.look_in(cloud)?;
        cloud.each_block(|_, rows| {
            let parts = rows.par_chunks(PART_POINTS * cloud.columns.row_size());
            let parts: Result<Vec<_>, DeliverError> = parts.map(|rows| find(cloud, rows)).collect();
            parts?.into_iter().flatten().for_each(|(k, off)| sums[k].add(off));
            Ok(())
        })?;
    }
    Ok(sums)
}
