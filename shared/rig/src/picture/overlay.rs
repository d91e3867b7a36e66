//! Points of the LiDAR over images.

use super::{Content, Picture, dot};
use crate::survey::{KeptSweep, Survey, decoded};
use drive::{Drive, Frame};
use geometry::{Point3, Pose};
use image::RgbImage;
use registration::DeskewTable;

/// Depths of the nearest color, red, and of the farthest one, blue, m.
pub const DEPTH_M: [f64; 2] = [3.0, 40.0];
/// Side length of a drawn point, px.
const SIDE: i64 = 2;

/// Up to three pictures of each camera: the first, the middle and the last exposure that a kept sweep covers.
pub(super) fn pictures(drive: &Drive, survey: &Survey) -> Vec<Picture> {
    let mut pictures = Vec::new();
    for (camera, entry) in drive.manifest().cameras.iter().enumerate() {
        let covered: Vec<(&Frame, &KeptSweep)> = drive
            .camera_frames()
            .iter()
            .filter(|frame| frame.camera == camera)
            .filter_map(|frame| Some((frame, survey.kept.iter().find(|sweep| covers(sweep, frame))?)))
            .collect();
        let n = covered.len();
        let mut chosen: Vec<(usize, &str)> = vec![(0, "first"), (n / 2, "middle"), (n.saturating_sub(1), "last")];
        chosen.dedup_by_key(|(index, _)| *index);
        for (index, which) in chosen.into_iter().filter(|(index, _)| *index < n) {
            let (frame, sweep) = covered[index];
            let Some(pixels) = overlay(drive, survey, frame, sweep) else { continue };
            pictures.push(Picture {
                file: format!("camera_{camera}_{which}.png"),
                caption: format!(
                    "{}, {which}: {}. Points by depth: red {} m, blue {} m and farther",
                    entry.name,
                    frame.path.display(),
                    DEPTH_M[0],
                    DEPTH_M[1]
                ),
                content: Content::Pixels(pixels),
            });
        }
    }
    pictures
}

fn covers(sweep: &KeptSweep, frame: &Frame) -> bool {
    let nanos = frame.stamp.0 - sweep.stamp.0;
    (0..=i64::from(sweep.duration_nanos.max(100_000_000))).contains(&nanos)
}

fn overlay(drive: &Drive, survey: &Survey, frame: &Frame, sweep: &KeptSweep) -> Option<RgbImage> {
    let entry = &drive.manifest().cameras[frame.camera];
    let pixels = decoded(frame, entry)?;
    let mut image = RgbImage::from_raw(pixels.width, pixels.height, pixels.bytes)?;
    let odom_from_body = survey.trajectory.at(frame.stamp)?;
    let camera = &drive.rig().cameras[frame.camera];
    let odom_from_camera = odom_from_body * camera.body_from_camera;
    let shown = in_frame(sweep, &odom_from_camera)
        .filter_map(|p| Some(ImagePoint { depth_m: p.coords.norm(), at: camera.model.pixel_from_camera(&p)?.into() }));
    draw_points(&mut image, shown.collect());
    Some(image)
}

/// A point in an image.
#[derive(Clone, Copy, Debug)]
pub struct ImagePoint {
    /// Distance from the camera, m.
    pub depth_m: f64,
    /// Column and row, px.
    pub at: [f64; 2],
}

/// Draws points into an image, colored by [`DEPTH_M`], near points on top.
pub fn draw_points(image: &mut RgbImage, mut points: Vec<ImagePoint>) {
    points.sort_by(|a, b| b.depth_m.total_cmp(&a.depth_m));
    for ImagePoint { depth_m, at } in points {
        dot(image, at, SIDE, color(depth_m));
    }
}

/// The deskewed points of a sweep in a frame with the given pose in the odometry frame.
pub(super) fn in_frame(sweep: &KeptSweep, odom_from_frame: &Pose) -> impl Iterator<Item = Point3<f64>> {
    let frame_from_odom = odom_from_frame.inverse();
    let [begin, end] =
        [sweep.motion.begin(), sweep.motion.end()].map(|odom_from_lidar| frame_from_odom * odom_from_lidar);
    let table = DeskewTable::new(&begin, &end, sweep.duration_nanos);
    // Without point times, all points have the pose in the middle.
    let mid = frame_from_odom * sweep.motion.mid;
    let duration = sweep.duration_nanos;
    sweep.rows.iter().map(move |row| {
        let at = [row.x, row.y, row.z];
        if duration == 0 {
            mid * Point3::from(at).cast::<f64>()
        } else {
            Point3::from(table.deskew(at, row.offset_nanos)).cast::<f64>()
        }
    })
}

/// Color from red over yellow, green and cyan to blue, linear in the logarithm of the depth.
fn color(depth_m: f64) -> [u8; 3] {
    let [near, far] = DEPTH_M;
    let share = ((depth_m / near).ln() / (far / near).ln()).clamp(0.0, 1.0);
    let hue = share * 4.0;
    let rise = ((hue.fract()) * 255.0) as u8;
    match hue as u32 {
        0 => [255, rise, 0],
        1 => [255 - rise, 255, 0],
        2 => [0, 255, rise],
        3 => [0, 255 - rise, 255],
        _ => [0, 0, 255],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_go_from_red_to_blue() {
        assert_eq!(
            [color(0.5), color(3.0), color(40.0), color(1e6)],
            [[255, 0, 0], [255, 0, 0], [0, 0, 255], [0, 0, 255]]
        );
        assert_eq!(color((3.0_f64 * 40.0).sqrt())[1], 255);
    }
}
