//! Places that are seen again.

mod correlation;
mod finder;
mod fit;
mod keyframe;
mod scan_context;

pub use finder::{ClosedLoop, LoopFinder, LoopSettings};
pub use keyframe::Keyframe;
