//! Procedural towns: terrain, streets, houses, vegetation, vehicles and people, each with class, instance and material.
//!
//! | module | content |
//! |---|---|
//! | [`terrain`](Terrain), `streets` | terrain, street map and lanes |
//! | `construction` | placement and order of all objects |
//! | `models` | geometry of each kind of object |
//! | `movers`, `path`, `speed_profile` | moving objects, their paths and speeds |
//! | [`material`], [`spectrum`] | reflectance and texture of surfaces |
//! | `scene` | the finished town, for ray casts |
//!
//! Start reading at [`build()`] in `construction/build.rs`: it builds a town step by step. [`Scene`] is the result.
//!
//! Frame: z up, metres, the drive starts near the origin. Times are seconds of the drive, wavelengths nm, reflectances 0 to 1.
//!
//! A town is determined by its [`Town`] kind, its seed, the length of the drive and the density of its [`Traffic`]: the
//! same four values give the same town, bit by bit. The crate must never use a clock or an unseeded random number, build
//! an object without class and material, or depend on sensors: `simulation` measures the town.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub mod catalogue;
mod construction;
mod kind;
pub mod material;
mod models;
mod movers;
pub mod noise;
mod path;
mod scene;
mod scene_builder;
pub mod spectrum;
mod speed_profile;
mod spline;
mod streets;
mod surface;
mod terrain;

pub use construction::build::{Drive, build};
pub use kind::{Town, Traffic};
pub use material::Material;
pub use movers::mover::{Mover, Route, Timing};
pub use path::GroundPath;
pub use scene::{Scene, SceneHit, Snapshot};
pub use spectrum::Spectrum;
pub use speed_profile::{Driver, FAST_MPS, SpeedProfile, Stop};
pub use streets::profile::LANE_T;
pub use surface::Surface;
pub use terrain::{MAX_SLOPE, Terrain};
