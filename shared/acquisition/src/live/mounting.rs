//! The sensor's model and rig.

use crate::error::LiveError;
use formats::drive::{LiveRig, lidar_of};
use formats::lidar::{Lidar, Model};
use formats::manifest::PoseEntry;
use formats::problems::FileError;
use std::path::Path;

/// Model and rig of a sensor on the network.
pub struct Mounting {
    /// `None`: the model is detected from the packets.
    pub(super) lidar: Option<Lidar>,
    pub(super) rig: LiveRig,
}

impl Mounting {
    /// Finds the rig of a drive folder. `model` is the name of the wanted model; empty = the model of the rig or of the packets.
    pub fn find(drive: &Path, model: &str) -> Result<Self, LiveError> {
        let rig = LiveRig::find(drive)?;
        let wanted = Model::from_name(model);
        let LiveRig::File(path, manifest) = &rig else {
            let lidar = wanted.map(Lidar::from);
            return needs_no_file(lidar.as_ref()).map(|()| Self { lidar, rig });
        };
        let of_rig = Model::from_name(&manifest.lidar.model);
        if wanted.is_some() && wanted != of_rig {
            return Err(LiveError::Model { setting: model.to_owned(), rig: manifest.lidar.model.clone() });
        }
        let lidar = lidar_of(path.parent().unwrap_or(Path::new("")), "lidar", &manifest.lidar);
        let lidar = lidar.map_err(|problem| FileError { problems: vec![problem] })?;
        needs_no_file(Some(&lidar))?;
        Ok(Self { lidar: Some(lidar), rig })
    }

    pub(super) fn body_from_lidar(&self) -> PoseEntry {
        self.rig.manifest().map_or(PoseEntry::IDENTITY, |manifest| manifest.lidar.body_from_lidar)
    }
}

/// Fails if the packets of a LiDAR cannot be decoded without a file of the unit.
fn needs_no_file(lidar: Option<&Lidar>) -> Result<(), LiveError> {
    let Some((lidar, file)) = lidar.and_then(|lidar| Some((lidar, lidar.missing_file()?))) else { return Ok(()) };
    Err(LiveError::Calibration { model: lidar.model().name().to_owned(), file })
}
