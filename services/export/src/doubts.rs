//! The end of the run: doubtful and refused results.

use crate::settings::Frame;
use crate::{Export, PlacedDrive};
use delivery::{Deviations, MedianAndLargest};
use doubts::Doubt;
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
            outputs.report_doubt(&Doubt::CloudsWithoutPlace { n_without, n_clouds });
        }
        let n_lost = outputs.counted("lost_columns");
        let n_columns = n_clouds * self.columns.n_expected();
        let limit = self.settings.max_lost_columns_share;
        if n_lost as f64 / n_columns.max(1) as f64 > limit {
            outputs.report_doubt(&Doubt::LostColumns { n_lost, n_columns, limit });
        }
    }

    /// Doubts of a georeferenced result.
    fn doubt_poses(&self, deviations: &Deviations, outputs: &mut Outputs) {
        let settings = &self.settings;
        if let Some(reason) = deviations.undetermined_heading(settings.max_heading_deviation_deg) {
            let largest_deg = deviations.heading_deg.largest;
            outputs.report_doubt(&Doubt::HeadingUndetermined { largest_deg, reason });
        }
        let MedianAndLargest { median: median_m, largest: largest_m } = deviations.position_m;
        let limit_m = settings.max_position_deviation_m;
        if largest_m > limit_m {
            outputs.report_doubt(&Doubt::PositionUncertain { largest_m, median_m, limit_m });
        }
        let MedianAndLargest { median: median_m, largest: largest_m } = deviations.height_m;
        let limit_m = settings.max_height_deviation_m;
        if largest_m > limit_m {
            outputs.report_doubt(&Doubt::HeightUncertain { largest_m, median_m, limit_m });
        }
    }

    fn doubt_contents(&self, outputs: &mut Outputs) {
        let n_clouds = self.clouds.len();
        if n_clouds == 0 {
            outputs.report_doubt(&Doubt::NoSubmaps);
        } else if self.clouds.iter().all(|cloud| cloud.n_points == 0) {
            outputs.report_doubt(&Doubt::NoPoints { n_clouds });
        }
    }

    /// Fails if the settings require UTM and the clouds are in another frame. All files are written before this check:
    /// a program that accepts doubtful results must not take local coordinates for UTM.
    pub(crate) fn check_utm(&self) -> Result<(), StepError> {
        let reason = match &self.placed {
            Some(PlacedDrive { world, .. }) => world.lacks_utm(),
            None => (self.settings.frame == Frame::Utm).then(|| "no placement arrived".to_owned()),
        };
        let Some(reason) = reason else { return Ok(()) };
        Err(StepError::configuration(format!(
            "frame = \"utm\": {reason}; the clouds are in local coordinates (see index.json); use frame = \"world\""
        )))
    }
}
