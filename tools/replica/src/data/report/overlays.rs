//! Points of the LiDAR over images of color and mosaic cameras, with the calibration and the path of the run.

use super::finished_run::FinishedRun;
use super::moment::points_around;
use crate::data::inspect::drive::pictures::{Picture, WIDTH, jpeg, thumbnail};
use drive::{Drive, Frame};
use formats::raw_mosaic::RawMosaic;
use geometry::{RigCamera, Stamp};
use image::{Rgb, RgbImage};
use rayon::prelude::*;
use rig::picture::{DEPTH_M, ImagePoint, draw_points};
use rig::survey::decoded;

/// Points this long before and after the exposure, s: together a revolution at the usual 10 Hz.
const HALF_S: f64 = 0.05;

/// The brightest share of the samples of a mosaic is drawn white.
const WHITE_SHARE: f64 = 0.01;

/// One picture of each camera, the color cameras first: the exposure nearest to `stamp`.
pub fn overlays(run: &FinishedRun, drive: &Drive, stamp: Stamp) -> Vec<Picture> {
    let nearest = |frames: &'_ [Frame], camera: usize| {
        let covered = frames.iter().filter(|frame| frame.camera == camera && run.trajectory.at(frame.stamp).is_some());
        covered.min_by_key(|frame| (frame.stamp.0 - stamp.0).abs()).cloned()
    };
    let n_cameras = [drive.manifest().cameras.len(), drive.manifest().mosaics.len()];
    let colors: Vec<Frame> = (0..n_cameras[0]).filter_map(|camera| nearest(drive.camera_frames(), camera)).collect();
    let mosaics: Vec<Frame> = (0..n_cameras[1]).filter_map(|camera| nearest(drive.mosaic_frames(), camera)).collect();
    let (mut pictures, more): (Vec<Picture>, Vec<Picture>) = rayon::join(
        || colors.par_iter().filter_map(|frame| overlay(run, drive, frame, WIDTH)).collect(),
        || mosaics.par_iter().filter_map(|frame| mosaic_overlay(run, drive, frame, WIDTH)).collect(),
    );
    pictures.extend(more);
    pictures
}

/// A picture of one exposure, at most `max_width` px wide. `None` if the image is damaged (`acquire` reports it) or no point is in it.
pub fn overlay(run: &FinishedRun, drive: &Drive, frame: &Frame, max_width: u32) -> Option<Picture> {
    let entry = &drive.manifest().cameras[frame.camera];
    let pixels = decoded(frame, entry)?;
    let full = RgbImage::from_raw(pixels.width, pixels.height, pixels.bytes)?;
    let image = with_points(run, frame.stamp, &drive.rig().cameras[frame.camera], &full, max_width)?;
    jpeg(title(&entry.name, drive, frame), &image)
}

/// A picture of one exposure of a mosaic camera: the brightness of all bands together.
fn mosaic_overlay(run: &FinishedRun, drive: &Drive, frame: &Frame, max_width: u32) -> Option<Picture> {
    let entry = &drive.manifest().mosaics[frame.camera];
    let full = brightness(&RawMosaic::read(&frame.path).ok()?, entry.pattern)?;
    let image = with_points(run, frame.stamp, &drive.rig().mosaics[frame.camera], &full, max_width)?;
    jpeg(title(&entry.name, drive, frame), &image)
}

/// The mean of each cell of the pattern as gray, of the size of the mosaic. `None` without a whole cell.
fn brightness(mosaic: &RawMosaic, pattern: u32) -> Option<RgbImage> {
    let [columns, rows] = [mosaic.width, mosaic.height].map(|side| side.checked_div(pattern).unwrap_or(0));
    let sample = |u: u32, v: u32| f64::from(mosaic.samples[v as usize * mosaic.width as usize + u as usize]);
    let mean = |cell: u32| {
        let u = cell % columns * pattern;
        let v = cell / columns * pattern;
        let sum: f64 = (0..pattern * pattern).map(|k| sample(u + k % pattern, v + k / pattern)).sum();
        sum / f64::from(pattern * pattern)
    };
    let cells: Vec<f64> = (0..columns * rows).map(mean).collect();
    let mut sorted = cells.clone();
    sorted.sort_by(f64::total_cmp);
    let white = sorted.get(((1.0 - WHITE_SHARE) * sorted.len() as f64) as usize)?.max(1.0);
    // Samples are proportional to light; screens expect its square root, about.
    let gray = |u: u32, v: u32| {
        let cell = (v / pattern).min(rows - 1) * columns + (u / pattern).min(columns - 1);
        Rgb([((cells[cell as usize] / white).clamp(0.0, 1.0).sqrt() * 255.0).round() as u8; 3])
    };
    Some(RgbImage::from_fn(mosaic.width, mosaic.height, gray))
}

/// A smaller copy of an image with the points of its exposure. `None` if no point is in it.
fn with_points(
    run: &FinishedRun,
    stamp: Stamp,
    camera: &RigCamera,
    full: &RgbImage,
    max_width: u32,
) -> Option<RgbImage> {
    let mut image = thumbnail(full, max_width)?;
    let scale = f64::from(image.width()) / f64::from(full.width());
    let camera_from_world = (run.trajectory.at(stamp)? * camera.body_from_camera).inverse();
    let points = points_around(run, stamp, HALF_S).ok()?;
    let shown = points.iter().filter_map(|point| {
        let p = camera_from_world * point.position;
        let at: [f64; 2] = camera.model.pixel_from_camera(&p)?.into();
        Some(ImagePoint { depth_m: p.coords.norm(), at: at.map(|v| (v + 0.5) * scale - 0.5) })
    });
    let shown: Vec<ImagePoint> = shown.collect();
    if shown.is_empty() {
        return None;
    }
    draw_points(&mut image, shown);
    Some(image)
}

fn title(camera: &str, drive: &Drive, frame: &Frame) -> String {
    let file = frame.path.strip_prefix(drive.folder()).unwrap_or(&frame.path);
    format!("{camera}: {}", file.display())
}

/// Legend of the colors.
pub fn legend() -> String {
    let [near, far] = DEPTH_M;
    format!(
        "Points of one revolution over the exposure in the middle of the path, by distance: red {near} m, blue {far} m and \
         farther. Edges of poles, cars and houses must coincide. Mosaic cameras are gray: the mean of their bands."
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_is_the_mean_of_each_cell() {
        // Cells of 2 x 2: means 0, 100, 25 and 400; one column and one row are left over.
        let samples = vec![0, 0, 400, 0, 9, 0, 0, 0, 0, 9, 50, 0, 400, 400, 9, 0, 50, 400, 400, 9, 9, 9, 9, 9, 9];
        let mosaic = RawMosaic { width: 5, height: 5, bit_depth: 10, exposure_nanos: None, samples };
        let image = brightness(&mosaic, 2).expect("has cells");
        let at = |u: u32, v: u32| image.get_pixel(u, v).0[0];
        assert_eq!(image.dimensions(), (5, 5));
        assert_eq!([at(0, 0), at(3, 1), at(1, 2), at(2, 3)], [0, 128, 64, 255]);
        assert_eq!((at(4, 0), at(0, 4)), (128, 64), "left-over pixels continue their neighbor");
        assert!(brightness(&mosaic, 6).is_none() && brightness(&mosaic, 0).is_none());
    }
}
