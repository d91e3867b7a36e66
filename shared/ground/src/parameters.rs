//! Parameters of the method, and their ranges.

use serde::{Deserialize, Serialize};

/// Longest gap that zones may bridge, cells.
pub const MAX_GAP_CELLS: usize = 256;

/// Scalars, in the metadata of a model file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Side of a cell of the grid, m, 0.02 to 2.
    pub cell_m: f64,
    /// Largest distance of points from the path of the LiDAR, m, 5 to 500.
    pub reach_m: f64,
    /// Side of the square of the opening, m, 1 to 50: wider than any object that covers the ground.
    pub window_m: f64,
    /// Largest height of ground above the opening, m, 0.05 to 5.
    pub low_m: f64,
    /// Largest slope of ground around the largest zone, 0 to 2: 0.15 are 15 m in 100 m. Other zones may be `low_m` higher.
    pub slope: f64,
    /// Largest height above the terrain of points that indicate an object in their cell, m, 0.1 to 10. Higher ones are crowns and roofs.
    pub standing_m: f64,
    /// Smallest area of a ground zone, m^2 of cells with points, 0 to 1000.
    pub min_zone_m2: f64,
    /// Largest standard deviation of ground from a plane of 1 m without the noise of the sensor, m, 0.005 to 10; larger deviations are low vegetation.
    /// The limit is two and three times as large for planes of 1.8 and 3.4 m where points are sparse.
    pub rough_m: f64,
}

/// All parameters of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// Scalars.
    pub settings: Settings,
    /// Tensor `steps_m`: largest step between ground cells that are 1, 2 … cells apart, m; 1 to 256 elements.
    pub steps_m: Vec<f32>,
    /// Largest distances of ground points from the terrain.
    pub tolerance: Tolerance,
}

/// Largest distances of ground points from the terrain, m, above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Below the terrain.
    pub below_m: f32,
    /// Above the terrain.
    pub above_m: f32,
    /// Above the terrain in cells with an object: the foot of the object is not ground.
    pub foot_m: f32,
}

/// A setting outside its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfRange {
    /// Name of the setting.
    pub key: &'static str,
    /// Value of the setting.
    pub value: f64,
    /// Smallest allowed value.
    pub low: f64,
    /// Largest allowed value.
    pub high: f64,
}

impl Default for Parameters {
    /// The parameters of `models/ground.safetensors`. They follow from the size of curbs and cars and from sensor noise; window and
    /// tolerance above were selected on four simulated towns, the tolerance below on single sweeps of an HDL-64E, an OS1-64 and a Livox
    /// Avia, where far ground is sparse. See the model card in models/README.md.
    fn default() -> Self {
        let settings = Settings {
            cell_m: 0.2,
            reach_m: 100.0,
            window_m: 20.0,
            low_m: 0.5,
            slope: 0.15,
            standing_m: 1.5,
            min_zone_m2: 2.0,
            rough_m: 0.045,
        };
        // Noise of 8 cm and a slope of 15 %, across gaps of up to 3 m.
        let steps_m = (1..=15).map(|gap| 0.08 + 0.15 * 0.2 * gap as f32).collect();
        // Below: noise, and slopes between sparse cells. Above: a curb in the same cell. With an object: three times the
        // noise of the LiDAR.
        Self { settings, steps_m, tolerance: Tolerance { below_m: 0.3, above_m: 0.25, foot_m: 0.06 } }
    }
}

impl Parameters {
    /// `steps_m` for cells that are `coarsened` times as large: the same distances in fewer cells, at least one.
    pub(crate) fn steps_of_cells(&self, coarsened: u32) -> Vec<f32> {
        let stride = (coarsened.max(1) as usize).min(self.steps_m.len());
        self.steps_m.iter().copied().skip(stride - 1).step_by(stride).collect()
    }
}

impl Settings {
    /// The first setting outside its range, if any.
    pub fn out_of_range(&self) -> Option<OutOfRange> {
        let rules = [
            ("cell_m", self.cell_m, 0.02, 2.0),
            ("reach_m", self.reach_m, 5.0, 500.0),
            ("window_m", self.window_m, 1.0, 50.0),
            ("low_m", self.low_m, 0.05, 5.0),
            ("slope", self.slope, 0.0, 2.0),
            ("standing_m", self.standing_m, 0.1, 10.0),
            ("min_zone_m2", self.min_zone_m2, 0.0, 1000.0),
            ("rough_m", self.rough_m, 0.005, 10.0),
        ];
        let rules = rules.map(|(key, value, low, high)| OutOfRange { key, value, low, high });
        rules.into_iter().find(|rule| !(rule.low..=rule.high).contains(&rule.value))
    }
}
