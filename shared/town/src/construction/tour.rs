//! The route of the ego vehicle through a town.

use crate::path::GroundPath;
use crate::speed_profile::{Driver, SpeedProfile};
use std::sync::Arc;

/// Path and speed of the ego vehicle.
#[derive(Clone, Debug)]
pub struct Tour {
    /// The path.
    pub path: Arc<GroundPath>,
    /// For each leg of the round, the positions where the path enters and leaves the street's own pavement, m along the
    /// path.
    pub legs: Vec<[f64; 2]>,
    /// Target speed and stops.
    pub driver: Driver,
    /// Distance along the path over time.
    pub speed: Arc<SpeedProfile>,
    /// Length of the drive, s.
    pub seconds: f64,
}
