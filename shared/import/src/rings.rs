//! The LiDAR of clouds that do not name it.

use lidar::{Model, hesai, livox, velodyne};

/// A model with this number of beams: for the later stages the number matters more than the maker.
pub(crate) fn model_of_beams(n_beams: usize) -> Model {
    match n_beams {
        0 => livox::Model::Mid360.into(),
        16 => velodyne::Model::Vlp16.into(),
        32 => velodyne::Model::Hdl32e.into(),
        40 => hesai::Model::Pandar40p.into(),
        64 => velodyne::Model::Hdl64e.into(),
        _ => Model::Ouster,
    }
}
