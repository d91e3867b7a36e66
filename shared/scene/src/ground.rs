//! The ground as heights on a lattice of 9.8 cm: measured, completed where objects hid it, and triangulated.

mod completion;
mod measured;
mod triangles;

pub use completion::{CompletedTile, Completion};
pub use measured::{GroundKind, GroundPoint, GroundVertex, MeasuredGround};
pub use triangles::triangles;
