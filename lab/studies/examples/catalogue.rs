//! Draws every model of the simulator with its own color camera: `catalogue OUT_DIR [SEED] [PART_OF_NAME]`.
//!
//! Writes sheets `catalogue_1.png` … of 6 by 4 pictures and prints the models' names in their order, row by row, with their
//! sizes.

use geometry::{CameraModel, Pinhole, Pose, Translation3, UnitQuaternion, Vector3};
use nalgebra::Rotation3;
use simulation::sensors::camera::ColorCamera;
use simulation::sensors::exposure::Exposure;
use simulation::{DriveSpec, Simulation};
use std::error::Error;
use std::path::PathBuf;
use town::catalogue::{Exhibit, exhibits};

/// Columns and rows of a picture on a sheet, px; the only picture is five times as wide.
const PICTURE: [u32; 2] = [240, 180];
/// Pictures on a sheet.
const SHEET: [usize; 2] = [6, 4];
/// A pixel is the mean of this many by this many rays.
const RAYS: usize = 3;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let out = PathBuf::from(arguments.next().ok_or("usage: catalogue OUT_DIR [SEED] [PART_OF_NAME]")?);
    let seed: u64 = arguments.next().map_or(Ok(1), |seed| seed.parse())?;
    let part = arguments.next().unwrap_or_default();
    std::fs::create_dir_all(&out)?;
    let shown: Vec<Exhibit> = exhibits(seed).filter(|exhibit| exhibit.name.contains(&part)).collect();
    let (picture, [columns, rows]) =
        if shown.len() == 1 { (PICTURE.map(|side| 5 * side), [1, 1]) } else { (PICTURE, SHEET) };
    let lens = lens(picture.map(|side| RAYS as u32 * side));
    let camera = ColorCamera::new(&CameraModel::Pinhole(lens.clone()));
    let motion = Simulation::new(&DriveSpec::urban(seed, 1.0))?.motion;
    let [wide, high] = picture.map(|side| side as usize);
    for (sheet, exhibits) in shown.chunks(columns * rows).enumerate() {
        let rows = exhibits.len().div_ceil(columns);
        let mut pixels = vec![0_u8; 3 * wide * columns * high * rows];
        for (i, exhibit) in exhibits.iter().enumerate() {
            println!("{:2} {}", sheet + 1, description(exhibit));
            // The camera is at rest: the vehicle that carries it has not started.
            let body_from_camera = motion.pose(0.0).inverse() * viewpoint(exhibit, &lens);
            let exposure = Exposure::new(&exhibit.scene, &motion, &body_from_camera, motion.begin, 1, seed);
            let shot = camera.shoot(&exposure, camera.meter(std::slice::from_ref(&exposure)), seed);
            for v in 0..high {
                let at = 3 * wide * ((i / columns * high + v) * columns + i % columns);
                for u in 0..wide {
                    pixels[at + 3 * u..at + 3 * u + 3].copy_from_slice(&mean(&shot, RAYS * wide, [RAYS * u, RAYS * v]));
                }
            }
        }
        let path = out.join(format!("catalogue_{}.png", sheet + 1));
        let [width, height] = [(wide * columns) as u32, (high * rows) as u32];
        image::save_buffer(path, &pixels, width, height, image::ExtendedColorType::Rgb8)?;
    }
    Ok(())
}

/// Mean of the square of [`RAYS`] whose first pixel is at the given column and row.
fn mean(pixels: &[u8], width: usize, [column, row]: [usize; 2]) -> [u8; 3] {
    let mut sum = [0_usize; 3];
    for v in row..row + RAYS {
        for u in column..column + RAYS {
            for (channel, sum) in sum.iter_mut().enumerate() {
                *sum += usize::from(pixels[3 * (v * width + u) + channel]);
            }
        }
    }
    sum.map(|sum| (sum / (RAYS * RAYS)) as u8)
}

fn description(exhibit: &Exhibit) -> String {
    let size = exhibit.bounds[1] - exhibit.bounds[0];
    let classes: Vec<&str> = exhibit.classes.iter().map(|class| class.name()).collect();
    format!(
        "{:32} {:5.1} x {:5.1} x {:5.1} m, {:5} primitives, {}",
        exhibit.name,
        size.x,
        size.y,
        size.z,
        exhibit.n_primitives,
        classes.join(", ")
    )
}

/// A lens with a field of view of 45 degrees.
fn lens([width, height]: [u32; 2]) -> Pinhole {
    let focal = 1.2 * f64::from(width);
    let [cx, cy] = [width, height].map(|side| 0.5 * f64::from(side));
    Pinhole { width, height, fx: focal, fy: focal, cx, cy, distortion: [0.0; 5] }
}

/// A viewpoint from the front right, as near as the whole model fits the picture. The sun is behind the camera.
fn viewpoint(exhibit: &Exhibit, lens: &Pinhole) -> Pose {
    let [low, high] = exhibit.bounds.map(nalgebra::Matrix::cast::<f64>);
    let low = Vector3::new(low.x, low.y, low.z.max(-1.5));
    let middle = (low + high) * 0.5;
    let backward = Vector3::new(-0.62, -0.85, 0.32).normalize();
    let right = (-backward).cross(&Vector3::z()).normalize();
    let down = (-backward).cross(&right);
    // Each corner of the bounds requires the distance at which it lies on the picture's edge.
    let distance = (0..8)
        .map(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
            let corner = Vector3::new(pick(0), pick(1), pick(2)) - middle;
            let across = (corner.dot(&right).abs() / (0.47 * f64::from(lens.width)))
                .max(corner.dot(&down).abs() / (0.47 * f64::from(lens.height)));
            corner.dot(&backward) + lens.fx * across
        })
        .fold(1.0, f64::max);
    let rotation = Rotation3::from_basis_unchecked(&[right, down, -backward]);
    Pose::from_parts(Translation3::from(middle + backward * distance), UnitQuaternion::from_rotation_matrix(&rotation))
}
