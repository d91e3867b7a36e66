//! Settings of the scan-to-map odometry.

use crate::{FeatureSettings, MapSettings, MatchSettings, SensorMounting};

/// Settings of all steps. Each part documents its defaults.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OdometrySettings {
    /// Feature selection.
    pub features: FeatureSettings,
    /// Extent of the map.
    pub map: MapSettings,
    /// Matching.
    pub matching: MatchSettings,
    /// Mounting of the sensors.
    pub mounting: SensorMounting,
    /// Longest time of a revolution, s, if the spin direction of a sensor without point times is to be determined, see
    /// [`turning`](crate::Odometry::turning). `None`: such sweeps are rigid.
    pub untimed_turn_s: Option<f64>,
}

impl OdometrySettings {
    /// Sets another spacing of the map's points, m, and the limits that depend on it.
    #[must_use]
    pub fn with_map_spacing(mut self, spacing_m: f64) -> Self {
        self.features.spacing_m = spacing_m;
        self.map.spacing_m = spacing_m;
        self.matching.fine.radius_m = 1.5 * spacing_m;
        self
    }
}
