//! What the next tick depends on, as bytes.

use crate::offset_watch::Watch;
use crate::window::Window;
use geometry::{Stamp, Trajectory};
use messages::{Cube, Image, Message, PoseRow, Submap};
use serde::{Deserialize, Serialize};
use stage::{Received, StepError};
use std::collections::{BTreeMap, VecDeque};

/// Raised with every change of the layout.
const VERSION: u32 = 4;

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
    /// What the images show where the points have edges.
    pub watch: Watch,
}

/// All but the messages, whose bytes follow it as they are: hundreds of megabytes should be copied only once.
#[derive(Serialize, Deserialize)]
struct Head {
    poses: Vec<(i64, [f64; 3], [f64; 4])>,
    bands_nm: BTreeMap<u32, Vec<f32>>,
    submaps_until: Option<i64>,
    watch: Watch,
    /// Bytes of each message.
    submaps: Vec<u64>,
    images: Vec<u64>,
    cubes: Vec<u64>,
}

/// Messages and all: length of the head u32 little-endian, head, submaps, images, cubes.
pub fn save(held: &Held) -> Result<Vec<u8>, StepError> {
    let pose = |(stamp, pose): &(Stamp, _)| {
        let row = PoseRow::from(*pose);
        (stamp.0, row.translation, row.rotation)
    };
    let head = Head {
        poses: held.trajectory.poses().iter().map(pose).collect(),
        bands_nm: held.bands_nm.clone(),
        submaps_until: held.submaps_until,
        watch: held.watch.clone(),
        submaps: held.submaps.iter().map(n_bytes).collect(),
        images: held.images.exposures().iter().map(n_bytes).collect(),
        cubes: held.cubes.exposures().iter().map(n_bytes).collect(),
    };
    let n_bytes: u64 = head.submaps.iter().chain(&head.images).chain(&head.cubes).sum();
    let head = stage::encode_state(VERSION, &head)?;
    let mut bytes = Vec::with_capacity(4 + head.len() + n_bytes as usize);
    bytes.extend_from_slice(&(head.len() as u32).to_le_bytes());
    bytes.extend_from_slice(&head);
    held.submaps.iter().for_each(|message| message.append_bytes(&mut bytes));
    held.images.exposures().iter().for_each(|message| message.append_bytes(&mut bytes));
    held.cubes.exposures().iter().for_each(|message| message.append_bytes(&mut bytes));
    Ok(bytes)
}

fn n_bytes<T: Message>(message: &Received<T>) -> u64 {
    message.n_bytes() as u64
}

/// The inverse of [`save`].
pub fn load(state: &[u8]) -> Result<Held, StepError> {
    let mut rest = Rest(state);
    let head_len = rest.take(4)?.iter().rev().fold(0, |len, byte| len << 8 | u64::from(*byte));
    let head: Head = stage::decode_state(VERSION, rest.take(head_len)?)?;
    let mut held =
        Held { submaps_until: head.submaps_until, bands_nm: head.bands_nm, watch: head.watch, ..Held::default() };
    for (stamp, translation, rotation) in head.poses {
        let pose = PoseRow { translation, rotation }.to_pose();
        if !pose.is_some_and(|pose| held.trajectory.push(Stamp(stamp), pose)) {
            return Err(StepError::data(format!("saved trajectory: pose at {stamp} ns is no pose or out of order")));
        }
    }
    held.submaps = rest.messages(&head.submaps)?.into();
    rest.messages(&head.images)?.into_iter().for_each(|image| held.images.add(image));
    rest.messages(&head.cubes)?.into_iter().for_each(|cube| held.cubes.add(cube));
    if !rest.0.is_empty() {
        return Err(StepError::data(format!("saved state: {} bytes more than its head says", rest.0.len())));
    }
    Ok(held)
}

/// What of a state has not been read yet.
struct Rest<'a>(&'a [u8]);

impl<'a> Rest<'a> {
    fn take(&mut self, n_bytes: u64) -> Result<&'a [u8], StepError> {
        let parts = usize::try_from(n_bytes).ok().and_then(|n| self.0.split_at_checked(n));
        let (taken, rest) = parts.ok_or_else(|| {
            StepError::data(format!("saved state: {n_bytes} bytes are due where {} are left", self.0.len()))
        })?;
        self.0 = rest;
        Ok(taken)
    }
    fn messages<T: Message>(&mut self, n_bytes: &[u64]) -> Result<Vec<Received<T>>, StepError> {
        n_bytes.iter().map(|n_bytes| Received::from_bytes(self.take(*n_bytes)?)).collect()
    }
}
