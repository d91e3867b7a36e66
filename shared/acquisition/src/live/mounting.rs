//! The sensor's model and rig.

use super::recorded_entries::RecordedEntries;
use crate::error::LiveError;
use drive::manifest::{LidarEntry, PoseEntry};
use drive::{LiveRig, lidar_of};
use files::problems::FileError;
use lidar::{Lidar, Model, Origin};
use settings::Rule;
use std::path::Path;

/// Rule for the model of [`Mounting::find`]: empty, or a model by its name.
pub struct EmptyOrModel;

impl Rule<String> for EmptyOrModel {
    fn allows(&self, name: &String) -> bool {
        name.is_empty() || Model::from_name(name).is_some()
    }
    fn text(&self) -> String {
        format!("must be one of , {}", Model::names())
    }
}

/// Model and rig of a sensor on the network.
pub struct Mounting {
    /// `None`: the model is detected from the packets.
    pub(super) lidar: Option<Lidar>,
    pub(super) rig: LiveRig,
    /// The secondary LiDARs of the rig.
    pub(super) secondary_lidars: Vec<SecondaryMounting>,
    /// Entries of the recording's manifest for the auxiliary sensors.
    pub(super) auxiliary: RecordedEntries,
}

/// A secondary LiDAR of the rig.
pub(super) struct SecondaryMounting {
    pub(super) lidar: Lidar,
    pub(super) entry: LidarEntry,
}

impl SecondaryMounting {
    /// The name, which [`drive::read_manifest`] has checked.
    pub(super) fn name(&self) -> &str {
        self.entry.name.as_deref().unwrap_or_default()
    }
}

impl Mounting {
    /// Finds the rig of a drive folder. `model` is the name of the requested model; empty = the model of the rig or of
    /// the packets.
    pub fn find(drive: &Path, model: &str) -> Result<Self, LiveError> {
        let rig = LiveRig::find(drive)?;
        let wanted = Model::from_name(model);
        let LiveRig::File(path, manifest) = &rig else {
            let lidar = wanted.map(Lidar::from);
            needs_no_file(lidar.as_ref())?;
            return Ok(Self { lidar, rig, secondary_lidars: Vec::new(), auxiliary: RecordedEntries::default() });
        };
        let of_rig = Model::from_name(&manifest.lidar.model);
        if wanted.is_some() && wanted != of_rig {
            return Err(LiveError::Model { setting: model.to_owned(), rig: manifest.lidar.model.clone() });
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        let lidar_of = |key: &str, entry: &LidarEntry| {
            let lidar = lidar_of(folder, key, entry).map_err(|problem| FileError { problems: vec![problem] })?;
            needs_no_file(Some(&lidar))?;
            // Each LiDAR has its own socket and capture.
            Ok::<_, LiveError>(lidar.with_origin(Origin::default()))
        };
        let lidar = lidar_of("lidar", &manifest.lidar)?;
        let other = |(index, entry): (usize, &LidarEntry)| {
            Ok(SecondaryMounting { lidar: lidar_of(&format!("lidar[{}]", index + 1), entry)?, entry: entry.clone() })
        };
        let secondary_lidars = manifest.other_lidars.iter().enumerate().map(other).collect::<Result<_, LiveError>>()?;
        Ok(Self { lidar: Some(lidar), rig, secondary_lidars, auxiliary: RecordedEntries::default() })
    }

    /// Adds entries of auxiliary sensors, which are recorded together with the LiDARs.
    #[must_use]
    pub fn with_auxiliary(self, auxiliary: &RecordedEntries) -> Self {
        Self { auxiliary: auxiliary.clone(), ..self }
    }

    /// Fails unless the numbers of addresses and LiDARs are equal.
    pub(super) fn check_number(&self, n_addresses: usize) -> Result<(), LiveError> {
        let n_lidars = 1 + self.secondary_lidars.len();
        if n_addresses == n_lidars { Ok(()) } else { Err(LiveError::Listen { n_addresses, n_lidars }) }
    }

    /// Name of the first LiDAR, if there are others.
    pub(super) fn name(&self) -> Option<String> {
        self.rig
            .manifest()
            .and_then(|manifest| manifest.lidar.name.clone())
            .filter(|_| !self.secondary_lidars.is_empty())
    }

    pub(super) fn body_from_lidar(&self) -> PoseEntry {
        self.rig.manifest().map_or(PoseEntry::IDENTITY, |manifest| manifest.lidar.body_from_lidar)
    }
}

/// Fails if the packets of a LiDAR cannot be decoded without a file of the unit.
fn needs_no_file(lidar: Option<&Lidar>) -> Result<(), LiveError> {
    // Some packets contain the content of the file.
    let lidar = lidar.filter(|lidar| !lidar.receives_calibration());
    let Some((lidar, file)) = lidar.and_then(|lidar| Some((lidar, lidar.missing_file()?))) else { return Ok(()) };
    Err(LiveError::Calibration { model: lidar.model().name().to_owned(), file })
}
