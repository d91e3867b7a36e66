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
            return Ok(Self { lidar: wanted.map(Lidar::from), rig });
        };
        let of_rig = Model::from_name(&manifest.lidar.model);
        if wanted.is_some() && wanted != of_rig {
            return Err(LiveError::Model { setting: model.to_owned(), rig: manifest.lidar.model.clone() });
        }
        let lidar = lidar_of(path.parent().unwrap_or(Path::new("")), &manifest.lidar);
        let lidar = lidar.map_err(|problem| FileError { problems: vec![problem] })?;
        Ok(Self { lidar: Some(lidar), rig })
    }

    pub(super) fn body_from_lidar(&self) -> PoseEntry {
        self.rig.manifest().map_or(PoseEntry::IDENTITY, |manifest| manifest.lidar.body_from_lidar)
    }
}
