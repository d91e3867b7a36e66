//! Standard deviations of the poses of all submaps.

use messages::{PlacementRow, PoseDeviation};
use serde::{Deserialize, Serialize};

/// The part of `georeference.json` about the standard deviations of the submaps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Deviations {
    /// Horizontal position.
    pub position_m: MedianAndLargest,
    /// Height.
    pub height_m: MedianAndLargest,
    /// Heading.
    pub heading_deg: MedianAndLargest,
}

/// Median and largest value of all submaps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MedianAndLargest {
    /// Median: half of the submaps have a smaller value.
    pub median: f64,
    /// Largest value of any submap.
    pub largest: f64,
}

impl MedianAndLargest {
    /// Median and largest of values; `None` without values.
    fn from_values(values: impl Iterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        Some(Self { median: *values.get(values.len() / 2)?, largest: *values.last()? })
    }
}

impl Deviations {
    /// Standard deviations from the rows of the placement; `None` without submaps.
    pub(crate) fn from_rows(rows: &[PlacementRow]) -> Option<Self> {
        let of = |value: fn(PoseDeviation) -> f64| {
            MedianAndLargest::from_values(rows.iter().map(|row| value(row.deviation())))
        };
        Some(Self {
            position_m: of(|deviation| deviation.position_m)?,
            height_m: of(|deviation| deviation.height_m)?,
            heading_deg: of(|deviation| deviation.heading_deg)?,
        })
    }

    /// Reason why the heading is undetermined, if a submap exceeds the limit.
    pub fn undetermined_heading(&self, limit: f64) -> Option<String> {
        let MedianAndLargest { median, largest } = self.heading_deg;
        (largest > limit).then(|| {
            format!("heading undetermined: standard deviation {largest:.1} degrees (limit {limit}), median {median:.1}")
        })
    }
}
