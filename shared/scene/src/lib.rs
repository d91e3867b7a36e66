//! Scene: a finished run as the static world of a simulator (`docs/guide/scene.md`).
//!
//! | idea | module |
//! |---|---|
//! | points that move or can move | `removal` |
//! | ground: measured heights, completion of what objects hid, triangles | [`ground`] |
//! | cross sections, lanes, OpenDRIVE | [`road`] |
//! | vehicles, people, poles, signs, lights | [`assets`] |
//! | glTF, 3D Tiles, points | `glb`, `tileset`, `static_points` |
//! | the same ground for the rasters of a delivery | [`CompletedTerrain`] |
//! | tiles of 50 m, written when no later cloud reaches them or their neighbors | `tile`, `writing` |
//!
//! Coordinates are in the frame of the clouds of the run: x east, y north, z up, m. This crate never changes the run. It invents nothing without
//! saying so: what was not measured has a score below 1.
//!
//! The same run gives the same bytes, for any number of threads. Memory holds the tiles that the LiDAR still sees, and 13 MB for each
//! kilometer of road.
//!
//! Start reading with `writing.rs`.

pub mod assets;
mod error;
mod glb;
pub mod ground;
mod removal;
pub mod road;
mod static_points;
mod terrain;
mod tile;
mod tileset;
mod writing;

pub use error::SceneError;
pub use glb::Mesh;
pub use removal::{Boxes, Removed, RemovedPoints, removed};
pub use static_points::{ScenePoint, StaticPoints, write_points};
pub use terrain::CompletedTerrain;
pub use tile::{STEP_M, STEPS, TILE_M, Tile, Vertex};
pub use tileset::{TileMesh, tileset};
pub use writing::{GROUND, OBJECTS, POINTS, ROADS, SUMMARY, SceneSummary, TILESET, write_scene};
