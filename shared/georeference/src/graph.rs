//! The pose graph: measurements, and the poses that fit them best.

mod bend;
mod elimination;
mod factors;
mod measurements;
mod solve;
mod tangent;

pub use measurements::{AntennaPosition, HorizontalVelocity, PoseGraph, RelativePose, UpDirection};
pub use solve::{Gauge, Solution, Start};
pub use tangent::moved;
