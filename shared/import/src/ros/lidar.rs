//! The sweeps of a bag: a file per cloud, or a capture of the packets.

mod capture;
mod sweeps;

pub(crate) use capture::Capture;
pub(crate) use sweeps::{FieldNames, Sweeps};

use formats::lidar::Model;
use formats::{hesai, livox, velodyne};

/// The model with this number of beams: what uses the sweeps needs the number more than the maker.
fn of_beams(n_beams: usize) -> Model {
    match n_beams {
        0 => livox::Model::Mid360.into(),
        16 => velodyne::Model::Vlp16.into(),
        32 => velodyne::Model::Hdl32e.into(),
        40 => hesai::Model::Pandar40p.into(),
        64 => velodyne::Model::Hdl64e.into(),
        _ => Model::Ouster,
    }
}
