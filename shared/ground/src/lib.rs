//! The ground below a submap, by lambda-quasi-flat zones of the top view (thesis section 6.3.2; Serna and Marcotegui 2014).
//!
//! [`Ground::find`] takes the points of a submap and gives the height of each point above the terrain, whether the terrain is rough
//! there, and the points that are ground. Networks use the heights as a feature; `ground.safetensors` is this method alone.
//!
//! 1. *Elevation* (`elevation.rs`): the lowest point of every cell of a top-view grid.
//! 2. *Zones* (`terrain.rs`): a cell is joined with its nearest neighbors in row and column, also across gaps, if the step between them
//!    is at most the step allowed for a gap of this length: a curb or a slope, but not the side of a car.
//! 3. *Ground zones*: large zones close to the morphological opening of the elevation. An opening keeps slopes, so the street may
//!    rise. Roofs of cars are small, crowns of trees are high. The roof of a house without visible ground around it is also low:
//!    zones other than the largest must not be higher than ground that rises from the largest zone like a steep street (as in the
//!    slope-based filter of Vosselman 2000).
//! 4. *Terrain*: the elevation of the ground zones with filled gaps (digital terrain model).
//! 5. *Roughness* (`roughness.rs`): where the lowest points scatter around a plane, low vegetation hides the ground.
//! 6. A point is ground if its distance to the terrain is within the tolerance, and the terrain is smooth. The upper tolerance admits
//!    a curb within a cell. In cells with an object, i.e. with points above the tolerance and below the height of a car, low points
//!    belong to the foot of the object, and the tolerance admits noise only. The score falls linearly from 1 on the terrain to 1/2 at
//!    the tolerance. It is not a probability.
//!
//! Road, sidewalk and terrain are not distinguished: a lowered curb joins their zones.
//!
//! This crate never reads a model file and never runs a network; it does not depend on `candle` or `segmentation`. The
//! result depends on the points and the parameters only, not on the number of threads. Memory is limited: the grid has
//! at most 2^24 cells and larger submaps get larger cells ([`Ground::coarsened`]).
//!
//! Where to start reading: `submap_ground.rs` has the method in the order above; [`Parameters::default`] gives the reasons for the values.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod elevation;
mod parameters;
mod roughness;
mod submap_ground;
mod terrain;

pub use parameters::{MAX_GAP_CELLS, OutOfRange, Parameters, Settings, Tolerance};
pub use submap_ground::{Ground, SubmapGround};
