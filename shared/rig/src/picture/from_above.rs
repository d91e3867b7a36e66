//! Top view of two overlaid sweeps, with and without deskewing.

use super::overlay::in_frame;
use super::{Content, Picture, dot};
use crate::check::level;
use crate::survey::{KeptSweep, Survey};
use drive::Drive;
use geometry::Point3;
use image::{Rgb, RgbImage};

/// Side of a picture, px, and of the square that it shows, m.
const SIDE_PX: u32 = 900;
const SIDE_M: f64 = 40.0;
/// Range of heights above the ground that are drawn, m: walls and vehicles, without the road.
const HEIGHT_M: [f64; 2] = [0.5, 4.0];
const COLORS: [[u8; 3]; 2] = [[0, 90, 190], [220, 90, 0]];

pub(super) fn pictures(drive: &Drive, survey: &Survey) -> Vec<Picture> {
    let mut sweeps = survey.kept.iter().filter(|sweep| sweep.is_from_above);
    let (Some(first), Some(second)) = (sweeps.next(), sweeps.next()) else { return Vec::new() };
    // Height of the ground in the body frame.
    let ground_m = level(survey, &drive.rig().body_from_lidar.rotation)
        .map(|level| drive.rig().body_from_lidar.translation.z - level.height_m);
    let rigid = |sweep: &KeptSweep| KeptSweep { duration_nanos: 0, ..sweep.clone() };
    let measured = [rigid(first), rigid(second)];
    let deskewed = [first.clone(), second.clone()];
    let picture = |file: &str, caption: &str, sweeps: &[KeptSweep; 2]| Picture {
        file: file.to_owned(),
        caption: format!(
            "{caption}: two sweeps (blue, then orange) from above, {SIDE_M} m wide. Walls must be thin lines"
        ),
        content: Content::Pixels(drawn(drive, sweeps, ground_m)),
    };
    vec![
        picture("sweeps_as_measured.png", "Without deskewing", &measured),
        picture("sweeps_deskewed.png", "Deskewed", &deskewed),
    ]
}

fn drawn(drive: &Drive, sweeps: &[KeptSweep; 2], ground_m: Option<f64>) -> RgbImage {
    let mut image = RgbImage::from_pixel(SIDE_PX, SIDE_PX, Rgb([255; 3]));
    let odom_from_body = sweeps[0].motion.mid * drive.rig().body_from_lidar.inverse();
    let per_m = f64::from(SIDE_PX) / SIDE_M;
    let is_shown =
        |p: &Point3<f64>| ground_m.is_none_or(|ground_m| (HEIGHT_M[0]..HEIGHT_M[1]).contains(&(p.z - ground_m)));
    for (sweep, color) in sweeps.iter().zip(COLORS) {
        for p in in_frame(sweep, &odom_from_body).filter(is_shown) {
            // Forward is up.
            let at = [0.5 * f64::from(SIDE_PX) - p.y * per_m, 0.5 * f64::from(SIDE_PX) - p.x * per_m];
            dot(&mut image, at, 2, color);
        }
    }
    image
}
