//! The sliding map of the surroundings: points with normals in cells of one metre, and the surface they define.

pub(crate) mod cell;
pub(crate) mod kernel;
pub(crate) mod local_map;
pub(crate) mod maps;
