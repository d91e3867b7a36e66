//! The saved state of the stage.

use camera_alignment::OffsetMonitor;
use coloring::{ExposureTally, ExposureWindow, HeldExposure};
use geometry::{Stamp, Trajectory};
use messages::{CubeTopic, ImageTopic, PoseRow, SubmapTopic};
use serde::{Deserialize, Serialize};
use stage::{Received, StateBytes, StepError, decode_head, next_message};
use std::collections::{BTreeMap, VecDeque};

/// Version of the layout. Incremented with every change.
const VERSION: u32 = 6;

/// The state between ticks.
#[derive(Default)]
pub struct Held {
    /// Poses `odom_from_body` that exposures may still need.
    pub trajectory: Trajectory,
    /// Submaps that are not yet colored, oldest first.
    pub submaps: VecDeque<Received<SubmapTopic>>,
    /// Color exposures.
    pub images: ExposureWindow<Received<ImageTopic>>,
    /// Spectral exposures.
    pub cubes: ExposureWindow<Received<CubeTopic>>,
    /// Last shot of the newest submap.
    pub submaps_until: Option<i64>,
    /// Alignment of points and images.
    pub monitor: OffsetMonitor,
}

pub fn held_image(data: Received<ImageTopic>) -> HeldExposure<Received<ImageTopic>> {
    HeldExposure { stamp: data.stamp(), camera: data.header().camera, data }
}

pub fn held_cube(data: Received<CubeTopic>) -> HeldExposure<Received<CubeTopic>> {
    HeldExposure { stamp: data.stamp(), camera: data.header().camera, data }
}

/// Everything except the messages, which follow it: submaps, images, cubes.
#[derive(Serialize, Deserialize)]
struct Head {
    poses: Vec<(i64, [f64; 3], [f64; 4])>,
    bands_nm: BTreeMap<u32, Vec<f32>>,
    submaps_until: Option<i64>,
    monitor: OffsetMonitor,
    image_tallies: BTreeMap<u32, ExposureTally>,
    cube_tallies: BTreeMap<u32, ExposureTally>,
    n_submaps: u64,
    n_images: u64,
    n_cubes: u64,
}

/// The saved state: head and messages.
pub fn save<'a>(held: &'a Held, bands_nm: &BTreeMap<u32, Vec<f32>>) -> Result<StateBytes<'a>, StepError> {
    let pose = |(stamp, pose): &(Stamp, _)| {
        let row = PoseRow::from(*pose);
        (stamp.0, row.translation, row.rotation)
    };
    let images = held.images.exposures();
    let cubes = held.cubes.exposures();
    let head = Head {
        poses: held.trajectory.poses().iter().map(pose).collect(),
        bands_nm: bands_nm.clone(),
        submaps_until: held.submaps_until,
        monitor: held.monitor.clone(),
        image_tallies: held.images.tallies().clone(),
        cube_tallies: held.cubes.tallies().clone(),
        n_submaps: held.submaps.len() as u64,
        n_images: images.len() as u64,
        n_cubes: cubes.len() as u64,
    };
    let mut state = StateBytes::with_head(VERSION, &head)?;
    for submap in &held.submaps {
        state.push(submap);
    }
    for image in images {
        state.push(&image.data);
    }
    for cube in cubes {
        state.push(&cube.data);
    }
    Ok(state)
}

/// The inverse of [`save`].
pub fn load(state: &[u8]) -> Result<(Held, BTreeMap<u32, Vec<f32>>), StepError> {
    let (head, mut rest): (Head, _) = decode_head(VERSION, state)?;
    let mut held = Held {
        submaps_until: head.submaps_until,
        monitor: head.monitor,
        images: ExposureWindow::with_tallies(head.image_tallies),
        cubes: ExposureWindow::with_tallies(head.cube_tallies),
        ..Held::default()
    };
    for (stamp, translation, rotation) in head.poses {
        let pose = PoseRow { translation, rotation }.to_pose();
        if !pose.is_some_and(|pose| held.trajectory.push(Stamp(stamp), pose)) {
            return Err(StepError::data(format!("saved trajectory: pose at {stamp} ns is invalid or out of order")));
        }
    }
    for _ in 0..head.n_submaps {
        held.submaps.push_back(next_message(&mut rest)?);
    }
    for _ in 0..head.n_images {
        held.images.restore(held_image(next_message(&mut rest)?));
    }
    for _ in 0..head.n_cubes {
        held.cubes.restore(held_cube(next_message(&mut rest)?));
    }
    if !rest.is_empty() {
        return Err(StepError::data(format!("saved state: {} bytes after the last message", rest.len())));
    }
    Ok((held, head.bands_nm))
}
