//! The sensor's model and rig.

use crate::error::LiveError;
use formats::drive::LiveRig;
use formats::manifest::PoseEntry;
use formats::velodyne::Model;
use std::path::Path;

/// Model and rig of a sensor on the network.
pub struct Mounting {
    /// `None`: it is detected from the packets.
    pub(super) model: Option<Model>,
    pub(super) rig: LiveRig,
}

impl Mounting {
    /// Finds the rig of a drive folder. `model` is the name of the wanted model; empty = the model of the rig or of the packets.
    pub fn find(drive: &Path, model: &str) -> Result<Self, LiveError> {
        let rig = LiveRig::find(drive)?;
        let wanted = Model::from_name(model);
        let Some(manifest) = rig.manifest() else { return Ok(Self { model: wanted, rig }) };
        let of_rig = Model::from_name(&manifest.lidar.model);
        if wanted.is_some() && wanted != of_rig {
            return Err(LiveError::Model { setting: model.to_owned(), rig: manifest.lidar.model.clone() });
        }
        Ok(Self { model: of_rig, rig })
    }

    pub(super) fn body_from_lidar(&self) -> PoseEntry {
        self.rig.manifest().map_or(PoseEntry::IDENTITY, |manifest| manifest.lidar.body_from_lidar)
    }
}
