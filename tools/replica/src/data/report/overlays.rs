//! Points of the LiDAR over images of the cameras, with the calibration and the path of the run.

use super::finished_run::FinishedRun;
use super::moment::points_around;
use crate::data::inspect::drive::pictures::{Picture, WIDTH, jpeg, thumbnail};
use formats::drive::{Drive, Frame};
use geometry::Stamp;
use image::RgbImage;
use rayon::prelude::*;
use rig::picture::{DEPTH_M, draw_points};
use rig::survey::decoded;

/// Points this long before and after the exposure, s: together a revolution at the usual 10 Hz.
const HALF_S: f64 = 0.05;

/// One picture of each color camera: the exposure nearest to `stamp`.
pub fn overlays(run: &FinishedRun, drive: &Drive, stamp: Stamp) -> Vec<Picture> {
    let frame_of = |camera: usize| {
        let frames = drive.camera_frames().iter().filter(|frame| frame.camera == camera);
        let covered = frames.filter(|frame| run.trajectory.at(frame.stamp).is_some());
        covered.min_by_key(|frame| (frame.stamp.0 - stamp.0).abs())
    };
    let frames: Vec<&Frame> = (0..drive.manifest().cameras.len()).filter_map(frame_of).collect();
    frames.par_iter().filter_map(|frame| overlay(run, drive, frame, WIDTH)).collect()
}

/// A picture of one exposure, at most `max_width` px wide. `None` if the image is damaged (`acquire` reports it) or no point is in it.
pub fn overlay(run: &FinishedRun, drive: &Drive, frame: &Frame, max_width: u32) -> Option<Picture> {
    let entry = &drive.manifest().cameras[frame.camera];
    let pixels = decoded(frame, entry)?;
    let full = RgbImage::from_raw(pixels.width, pixels.height, pixels.bytes)?;
    let mut image = thumbnail(&full, max_width)?;
    let scale = f64::from(image.width()) / f64::from(full.width());
    let camera = &drive.rig().cameras[frame.camera];
    let camera_from_world = (run.trajectory.at(frame.stamp)? * camera.body_from_camera).inverse();
    let points = points_around(run, frame.stamp, HALF_S).ok()?;
    let shown = points.iter().filter_map(|point| {
        let p = camera_from_world * point.position;
        let at: [f64; 2] = camera.model.pixel_from_camera(&p)?.into();
        Some((p.coords.norm(), at.map(|v| (v + 0.5) * scale - 0.5)))
    });
    let shown: Vec<(f64, [f64; 2])> = shown.collect();
    if shown.is_empty() {
        return None;
    }
    draw_points(&mut image, shown);
    let file = frame.path.strip_prefix(drive.folder()).unwrap_or(&frame.path);
    jpeg(format!("{}: {}", entry.name, file.display()), &image)
}

/// What the colors are.
pub fn legend() -> String {
    let [near, far] = DEPTH_M;
    format!(
        "Points of one revolution over the exposure in the middle of the path, by distance: red {near} m, blue {far} m and \
         farther. Edges of poles, cars and houses must lie on each other."
    )
}
