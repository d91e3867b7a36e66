//! Standard deviations of the poses of all submaps.

use crate::settings::Settings;
use messages::{PlacementRow, PoseDeviation};
use serde::Serialize;
use stage::Outputs;

/// The part of `georeference.json` about the standard deviations of the submaps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Deviations {
    /// Horizontal.
    position_m: MedianAndLargest,
    height_m: MedianAndLargest,
    heading_deg: MedianAndLargest,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct MedianAndLargest {
    median: f64,
    largest: f64,
}

impl MedianAndLargest {
    /// `None` without values.
    fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        Some(Self { median: *values.get(values.len() / 2)?, largest: *values.last()? })
    }
}

impl Deviations {
    /// `None` without submaps.
    pub fn of(rows: &[PlacementRow]) -> Option<Self> {
        let of = |value: fn(PoseDeviation) -> f64| MedianAndLargest::of(rows.iter().map(|row| value(row.deviation())));
        Some(Self {
            position_m: of(|deviation| deviation.position_m)?,
            height_m: of(|deviation| deviation.height_m)?,
            heading_deg: of(|deviation| deviation.heading_deg)?,
        })
    }

    /// Why the heading is undetermined, if it is.
    pub fn undetermined_heading(&self, settings: &Settings) -> Option<String> {
        let (MedianAndLargest { median, largest }, limit) = (self.heading_deg, settings.max_heading_deviation_deg);
        (largest > limit).then(|| {
            format!("heading undetermined: standard deviation {largest:.1} degrees (limit {limit}), median {median:.1}")
        })
    }

    /// Doubts of a georeferenced result.
    pub fn report_doubts(&self, settings: &Settings, outputs: &mut Outputs) {
        if let Some(text) = self.undetermined_heading(settings) {
            let advice = "results may be turned about the vertical; a longer drive with fixes is needed";
            outputs.doubt("heading_undetermined", self.heading_deg.largest, format!("{text}; {advice}"));
        }
        for (doubt, what, MedianAndLargest { median, largest }, limit) in [
            ("position_uncertain", "horizontal position", self.position_m, settings.max_position_deviation_m),
            ("height_uncertain", "height", self.height_m, settings.max_height_deviation_m),
        ] {
            if largest > limit {
                let text = format!(
                    "{what} of the submaps uncertain: standard deviation {largest:.1} m (limit {limit}), median {median:.1} m"
                );
                outputs.doubt(doubt, largest, text);
            }
        }
    }
}
