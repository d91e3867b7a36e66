//! Loop closures: places that the vehicle visits again.

mod correlation;
mod finder;
mod keyframe;
mod places;
mod refinement;
mod scan_context;

pub use finder::{LoopClosure, LoopFinder, LoopSettings};
pub use keyframe::{Keyframe, SurfacePoint};
pub use places::Places;
pub use refinement::{Fit, FitFloor, refine, surface_map};
