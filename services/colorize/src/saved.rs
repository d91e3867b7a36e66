//! What the next tick depends on, as bytes.

use crate::window::{Exposure, Window};
use geometry::{Stamp, Trajectory};
use messages::{Cube, Image, Message, PoseRow, Submap};
use serde::{Deserialize, Serialize};
use stage::{Bytes, Received, StepError};
use std::collections::{BTreeMap, VecDeque};

/// Raised with every change of [`Saved`].
const VERSION: u32 = 2;

/// Everything that is held from tick to tick.
#[derive(Default)]
pub struct Held {
    /// `world_from_body`, as far back as exposures may need it.
    pub trajectory: Trajectory,
    /// Not yet colored, oldest first.
    pub submaps: VecDeque<Received<Submap>>,
    /// Color exposures.
    pub images: Window<Image>,
    /// Spectral exposures.
    pub cubes: Window<Cube>,
    /// Wavelengths of each mosaic camera whose first cube has come, nm.
    pub bands_nm: BTreeMap<u32, Vec<f32>>,
    /// Last shot of the newest submap.
    pub submaps_until: Option<i64>,
}

#[derive(Serialize, Deserialize)]
struct Saved {
    poses: Vec<(i64, [f64; 3], [f64; 4])>,
    submaps: Vec<Bytes>,
    images: Vec<Bytes>,
    cubes: Vec<Bytes>,
    bands_nm: BTreeMap<u32, Vec<f32>>,
    submaps_until: Option<i64>,
}

/// Messages and all.
pub fn save(held: &Held) -> Result<Vec<u8>, StepError> {
    let pose = |(stamp, pose): &(Stamp, _)| {
        let row = PoseRow::from(*pose);
        (stamp.0, row.translation, row.rotation)
    };
    let saved = Saved {
        poses: held.trajectory.poses().iter().map(pose).collect(),
        submaps: held.submaps.iter().map(Received::to_bytes).collect(),
        images: held.images.exposures().iter().map(Received::to_bytes).collect(),
        cubes: held.cubes.exposures().iter().map(Received::to_bytes).collect(),
        bands_nm: held.bands_nm.clone(),
        submaps_until: held.submaps_until,
    };
    Ok(stage::encode_state(VERSION, &saved)?)
}

/// The inverse of [`save`].
pub fn load(state: &[u8]) -> Result<Held, StepError> {
    let saved: Saved = stage::decode_state(VERSION, state)?;
    let mut held = Held { submaps_until: saved.submaps_until, bands_nm: saved.bands_nm, ..Held::default() };
    for (stamp, translation, rotation) in saved.poses {
        let pose = PoseRow { translation, rotation }.to_pose();
        if !pose.is_some_and(|pose| held.trajectory.push(Stamp(stamp), pose)) {
            return Err(StepError::data(format!("saved trajectory: pose at {stamp} ns is no pose or out of order")));
        }
    }
    held.submaps = messages(&saved.submaps)?.into();
    add_all(&mut held.images, &saved.images)?;
    add_all(&mut held.cubes, &saved.cubes)?;
    Ok(held)
}

fn messages<T: Message>(saved: &[Bytes]) -> Result<Vec<Received<T>>, StepError> {
    saved.iter().map(|bytes| Received::from_bytes(bytes)).collect()
}

fn add_all<T: Exposure>(window: &mut Window<T>, saved: &[Bytes]) -> Result<(), StepError> {
    for exposure in messages(saved)? {
        window.add(exposure);
    }
    Ok(())
}
