//! Positions that were picked in clouds, in the coordinates of the delivery.
//!
//! A position of the coordinates of the delivery stays. A position in a cloud of a drive of a survey moves with the submap whose
//! points are nearest to it.

use super::CheckPoint;
use crate::cloud::Cloud;
use crate::error::DeliverError;
use crate::run_folder::RunFolder;
use crate::target_frame::TargetFrame;
use geometry::{Point3, Vector3};
use std::path::{Path, PathBuf};

/// Points of a cloud within this distance show the picked position, m.
const REACH_M: f64 = 1.0;

/// The picked position of each check point.
pub(super) struct Picked {
    picks: Vec<Option<Pick>>,
}

/// A position in the clouds of a run.
struct Pick {
    run: PathBuf,
    p_in_run: Point3<f64>,
    nearest: Option<Nearest>,
}

/// The position after the motion of the cloud whose point is nearest.
struct Nearest {
    distance_m: f64,
    position: Point3<f64>,
}

impl Picked {
    /// The positions in clouds of drives. The drive of a point must be one of the drives of a survey.
    pub fn new(runs: &[RunFolder], points: &[CheckPoint]) -> Result<Self, DeliverError> {
        let pick = |point: &CheckPoint| {
            let (Some(in_cloud), Some(drive)) = (point.in_cloud, &point.drive) else { return Ok(None) };
            let is_run = |run: &&RunFolder| run.survey_name.as_ref().is_none_or(|name| name == drive);
            let Some(run) = runs.iter().find(is_run) else {
                let names: Vec<&str> = runs.iter().filter_map(|run| run.survey_name.as_deref()).collect();
                let rule = format!("point {:?}: drive {drive:?} must be one of {}", point.name, names.join(", "));
                return Err(DeliverError::content(Path::new("check points"), rule));
            };
            Ok(Some(Pick { run: run.path().to_owned(), p_in_run: in_cloud.into(), nearest: None }))
        };
        Ok(Self { picks: points.iter().map(pick).collect::<Result<_, _>>()? })
    }

    /// Looks for points of a cloud near the positions.
    pub fn look_in(&mut self, cloud: &Cloud<'_>) -> Result<(), DeliverError> {
        let Some([low, high]) = cloud.entry.bounds else { return Ok(()) };
        let [low, high] = [Vector3::from(low).add_scalar(-REACH_M), Vector3::from(high).add_scalar(REACH_M)];
        let is_in = |pick: &Pick| {
            let p = pick.p_in_run.coords;
            pick.run == cloud.run.path() && low.inf(&p) == low && high.sup(&p) == high
        };
        let mut picks: Vec<&mut Pick> = self.picks.iter_mut().flatten().filter(|pick| is_in(pick)).collect();
        if picks.is_empty() {
            return Ok(());
        }
        let moved = |p: &Point3<f64>| cloud.run.correction(cloud.entry.seq).map_or(*p, |correction| correction * p);
        cloud.each_block(|_, rows| {
            for row in rows.chunks_exact(cloud.columns.row_size()) {
                let xyz = Point3::from(cloud.columns.point(row).xyz);
                for pick in &mut picks {
                    let position = moved(&pick.p_in_run);
                    let distance_m = (xyz - position).norm();
                    let limit_m = pick.nearest.as_ref().map_or(REACH_M, |nearest| nearest.distance_m);
                    if distance_m < limit_m {
                        pick.nearest = Some(Nearest { distance_m, position });
                    }
                }
            }
            Ok(())
        })
    }

    /// The position of each check point in the coordinates of the delivery, m. `None`: no position, or no points near it.
    pub fn positions(
        &self,
        frame: &TargetFrame<'_>,
        points: &[CheckPoint],
    ) -> Result<Vec<Option<[f64; 3]>>, DeliverError> {
        let position = |(point, pick): (&CheckPoint, &Option<Pick>)| match pick {
            None => Ok(point.in_cloud),
            Some(Pick { nearest: None, .. }) => Ok(None),
            Some(Pick { nearest: Some(Nearest { position, .. }), .. }) => {
                Ok(Some(frame.from_cloud(position.coords.into())?))
            }
        };
        points.iter().zip(&self.picks).map(position).collect()
    }
}
