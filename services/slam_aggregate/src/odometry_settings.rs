//! From the stage's settings to the odometry's.

use crate::Settings;
use registration::{OdometrySettings, Sampling, SensorPlaces};

pub(crate) fn odometry_settings(settings: &Settings, places: SensorPlaces) -> OdometrySettings {
    let mut odometry = OdometrySettings { places, ..OdometrySettings::default() };
    odometry.features.min_range_m = odometry.features.min_range_m.max(settings.min_range_m as f32);
    odometry.features.max_range_m = settings.max_range_m as f32;
    odometry.features.spacing_m = settings.map_spacing_m;
    odometry.map.spacing_m = settings.map_spacing_m;
    odometry.map.batches = settings.map_sweeps;
    odometry.map.max_points = settings.map_points_max as usize;
    if let Sampling::Even { max_features, .. } = &mut odometry.matching.sampling {
        *max_features = settings.matches_max as usize;
    }
    odometry.matching.fine.0 = 1.5 * settings.map_spacing_m;
    odometry
}
