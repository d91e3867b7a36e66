//! PLY point clouds.
