//! Data of a sweep that the odometry keeps until the next sweep.

use crate::{Feature, FeatureSettings, Sweep, planar_features};
use geometry::{Stamp, Vector3};
use serde::{Deserialize, Serialize};

/// Features of a sweep, without its points.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SweepFeatures {
    pub stamp: Stamp,
    pub mid_stamp: Stamp,
    pub duration_nanos: u32,
    pub duration_s: f64,
    /// All features, for the map.
    pub features: Vec<Feature>,
    /// A sample of the smooth features, for matching.
    pub matching: Vec<Feature>,
    /// A sample of the smooth and rough features, for matching.
    pub with_rough: Vec<Feature>,
}

impl SweepFeatures {
    /// `up_in_lidar` points upwards; `sample` chooses the features to match.
    pub fn new(
        sweep: &Sweep,
        up_in_lidar: &Vector3<f32>,
        settings: &FeatureSettings,
        sample: impl Fn(&[Feature]) -> Vec<Feature>,
    ) -> Self {
        let features = planar_features(sweep, up_in_lidar, settings);
        let (smooth, rough) = features.split_at(features.partition_point(|feature| !feature.is_rough));
        let matching = sample(smooth);
        let with_rough = matching.iter().copied().chain(sample(rough)).collect();
        Self {
            stamp: sweep.stamp(),
            mid_stamp: sweep.mid_stamp(),
            duration_nanos: sweep.duration_nanos(),
            duration_s: f64::from(sweep.duration_nanos()) * 1e-9,
            matching,
            with_rough,
            features,
        }
    }
}
