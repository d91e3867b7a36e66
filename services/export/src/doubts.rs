//! The end of the run: which results are doubtful, and which are refused.

use crate::settings::Frame;
use crate::{Export, PlacedDrive};
use delivery::{Deviations, MedianAndLargest};
use stage::{ColumnTable, Outputs, StepError};

impl<C: ColumnTable> Export<C> {
    pub(crate) fn report_doubts(&self, outputs: &mut Outputs) {
        if let Some(deviations) = self.placed.as_ref().and_then(|placed| placed.world.deviations()) {
            self.doubt_poses(&deviations, outputs);
        }
        if !self.settings.formats.is_empty() {
            self.doubt_contents(outputs);
        }
        let n_clouds = self.clouds.len();
        let n_without = outputs.counted("clouds_without_place");
        if n_without > 0 {
            let text =
                format!("{n_without} of {n_clouds} clouds have no placement: they stay in the frame of the odometry");
            outputs.doubt("clouds_without_place", n_without as f64 / n_clouds.max(1) as f64, text);
        }
        let (n_lost, n_columns) = (outputs.counted("lost_columns"), n_clouds * self.columns.n_expected());
        let (share, limit) = (n_lost as f64 / n_columns.max(1) as f64, self.settings.max_lost_columns_share);
        if share > limit {
            let text = format!(
                "{n_lost} of {n_columns} columns of the clouds were lost ({:.1} %, limit {:.1} %); index.json lists them",
                100.0 * share,
                100.0 * limit
            );
            outputs.doubt("lost_columns", share, text);
        }
    }

    /// Doubts of a georeferenced result.
    fn doubt_poses(&self, deviations: &Deviations, outputs: &mut Outputs) {
        let settings = &self.settings;
        if let Some(text) = deviations.undetermined_heading(settings.max_heading_deviation_deg) {
            let advice = "results may be turned about the vertical; a longer drive with fixes is needed";
            outputs.doubt("heading_undetermined", deviations.heading_deg.largest, format!("{text}; {advice}"));
        }
        for (doubt, what, MedianAndLargest { median, largest }, limit) in [
            ("position_uncertain", "horizontal position", deviations.position_m, settings.max_position_deviation_m),
            ("height_uncertain", "height", deviations.height_m, settings.max_height_deviation_m),
        ] {
            if largest > limit {
                let text = format!(
                    "{what} of the submaps uncertain: standard deviation {largest:.1} m (limit {limit}), median {median:.1} m"
                );
                outputs.doubt(doubt, largest, text);
            }
        }
    }

    fn doubt_contents(&self, outputs: &mut Outputs) {
        let n_clouds = self.clouds.len();
        if n_clouds == 0 {
            outputs.doubt(
                "no_submaps",
                0.0,
                "the result has no cloud: no submap arrived; did acquire decode any sweep?",
            );
        } else if self.clouds.iter().all(|cloud| cloud.n_points == 0) {
            let text =
                format!("the result has no point: all {n_clouds} submaps are empty; check min_range_m and the LiDAR");
            outputs.doubt("no_points", 0.0, text);
        }
    }

    /// Fails if the settings require UTM and the clouds are in another frame. All files are written before: a program that accepts
    /// doubtful results must not take local coordinates for UTM.
    pub(crate) fn check_utm(&self) -> Result<(), StepError> {
        let reason = match &self.placed {
            Some(PlacedDrive { world, .. }) => world.lacks_utm(),
            None => (self.settings.frame == Frame::Utm).then(|| "no placement arrived".to_owned()),
        };
        let Some(reason) = reason else { return Ok(()) };
        Err(StepError::configuration(format!(
            "frame = \"utm\": {reason}; the clouds are in local coordinates (see index.json); use frame = \"world\", or accept \
             the heading with max_heading_deviation_deg = 180"
        )))
    }
}
